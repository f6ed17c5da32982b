/* kernels.h -- one path of the linear algebra for all processors. */
#ifndef APSM_CLI_KERNELS_H
#define APSM_CLI_KERNELS_H

/* OpenBLAS takes the kernels of the processor it finds, and they round differently.  On x86-64 with
 * AVX2 this starts the program anew with those of Haswell, which are as fast here, unless
 * OPENBLAS_CORETYPE is set: OpenBLAS reads it before main begins. */
void cli_pin_kernels(char **argv);

#endif
