/* kernel.h -- marks the few loops that are worth compiling for AVX2 as well.  The arithmetic is
 * the same (no contraction, no reassociation beyond what the source asks for), so results agree
 * between the two versions wherever the source fixes the order of summation.  The clone is named
 * by the feature: "arch=haswell" would be taken on Intel's Haswell alone. */
#ifndef APSM_CORE_KERNEL_H
#define APSM_CORE_KERNEL_H

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(APSM_SANITIZE)
#define APSM_KERNEL __attribute__((target_clones("avx2", "default")))
#else
#define APSM_KERNEL
#endif

/* For what such loops call: into the versions of the kernel; a function of its own would be
 * compiled for the oldest machine only. */
#ifdef __GNUC__
#define KERNEL_INLINE static inline __attribute__((always_inline))
#else
#define KERNEL_INLINE static inline
#endif

#endif
