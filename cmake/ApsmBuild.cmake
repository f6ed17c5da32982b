# Flags, and what a room is: an object library of the files in src/NAME.
option(APSM_TESTS "build the tests" ON)
option(APSM_BENCHMARKS "build the benchmarks" OFF)
option(APSM_SANITIZE "address and undefined-behaviour sanitizers" OFF)
option(APSM_TSAN "thread sanitizer (clang and its libomp; see make tsan)" OFF)
option(APSM_WERROR "warnings are errors" OFF)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()
set(CMAKE_C_STANDARD 17)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_INSTALL_RPATH $ORIGIN/../${CMAKE_INSTALL_LIBDIR})
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_C_FLAGS_RELEASE "-O3 -g")
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})

# Values must not depend on the compiler's mood: no contraction, no fast-math.
set(APSM_C_FLAGS -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wstrict-prototypes
    -ffp-contract=off -fno-math-errno -fno-trapping-math -fopenmp-simd -fvisibility=hidden)
# Two rounds of an outer loop jammed together keep the inner one from becoming vector code.
if(CMAKE_C_COMPILER_ID STREQUAL "GNU")
  list(APPEND APSM_C_FLAGS -fno-loop-unroll-and-jam)
endif()
if(APSM_WERROR)
  list(APPEND APSM_C_FLAGS -Werror)
endif()
# Only libraries that are used: each costs start-up time.
add_link_options(-Wl,--as-needed)
if(APSM_SANITIZE)
  add_compile_options(-fsanitize=address,undefined -fno-sanitize-recover=all
                      -fno-omit-frame-pointer)
  # The checks inserted make gcc see null pointers where there are none.
  list(APPEND APSM_C_FLAGS -Wno-format-truncation -Wno-maybe-uninitialized -Wno-nonnull)
  add_link_options(-fsanitize=address,undefined)
  add_compile_definitions(APSM_SANITIZE)
endif()

if(APSM_TSAN)
  add_compile_options(-fsanitize=thread -fno-omit-frame-pointer)
  add_link_options(-fsanitize=thread)
endif()

# What pieces of the library need from outside.
set(APSM_LINK OpenMP::OpenMP_C PkgConfig::JANSSON PkgConfig::MINIZIP EXPAT::EXPAT PNG::PNG ZLIB::ZLIB ${LAPACKE_LIBRARY} ${BLAS_LIBRARY})
if(APSM_STATIC)
  add_link_options(-static)
  list(APPEND APSM_LINK gfortran quadmath) # what archives of LAPACK do not say that they need
else()
  list(APPEND APSM_LINK PkgConfig::XLSXWRITER)
endif()
list(APPEND APSM_LINK m)
set(APSM_ROOMS "" CACHE INTERNAL "")

function(apsm_c_target target)
  target_compile_definitions(${target} PRIVATE _POSIX_C_SOURCE=200809L _XOPEN_SOURCE=700)
  target_include_directories(${target} PRIVATE ${CMAKE_SOURCE_DIR}/include ${CMAKE_SOURCE_DIR}/src)
  target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:C>:${APSM_C_FLAGS}>)
  target_link_libraries(${target} PRIVATE ${APSM_LINK})
endfunction()

macro(apsm_room name)
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/src/${name}/*.c)
  if(sources)
    add_library(room_${name} OBJECT ${sources})
    apsm_c_target(room_${name})
    target_compile_definitions(room_${name} PRIVATE APSM_VERSION="${PROJECT_VERSION}")
    list(APPEND APSM_ROOMS ${name})
  endif()
endmacro()

# The bytes of a file as the array `symbol` (and symbol_size) in a target.
function(apsm_embed target file symbol)
  set(out ${CMAKE_BINARY_DIR}/${symbol}.c)
  set(script ${CMAKE_SOURCE_DIR}/cmake/EmbedFile.cmake)
  add_custom_command(OUTPUT ${out} DEPENDS ${CMAKE_SOURCE_DIR}/${file} ${script}
    COMMAND ${CMAKE_COMMAND} -DIN=${CMAKE_SOURCE_DIR}/${file} -DOUT=${out} -DNAME=${symbol}
            -P ${script})
  target_sources(${target} PRIVATE ${out})
endfunction()

# What the shared library shows: the functions that the public headers mark with APSM_API.  Hidden
# visibility alone leaves functions that choose their code by the processor.
function(apsm_export_list out)
  file(GLOB headers CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/include/apsm/*.h)
  set(names)
  foreach(header ${headers})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${header})
    file(READ ${header} text)
    string(REGEX MATCHALL "APSM_API [^(;#]*apsm_[a-z0-9_]+\\(" found "${text}")
    foreach(line ${found})
      string(REGEX REPLACE ".*(apsm_[a-z0-9_]+)\\($" "\\1" name "${line}")
      list(APPEND names ${name})
    endforeach()
  endforeach()
  list(JOIN names ";\n  " names)
  file(CONFIGURE OUTPUT ${out} CONTENT "{ global:\n  @names@;\nlocal: *; };\n" @ONLY)
endfunction()

# The library is all rooms together.
macro(apsm_library)
  set(objects)
  foreach(room ${APSM_ROOMS})
    list(APPEND objects $<TARGET_OBJECTS:room_${room}>)
  endforeach()
  apsm_export_list(${CMAKE_BINARY_DIR}/apsm.map)
  add_library(apsm SHARED ${objects})
  target_link_options(apsm PRIVATE -Wl,--version-script=${CMAKE_BINARY_DIR}/apsm.map)
  target_link_libraries(apsm PUBLIC ${APSM_LINK})
  target_include_directories(apsm PUBLIC $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}/include>)
  if(NOT APSM_SANITIZE)
    target_link_options(apsm PRIVATE -Wl,-z,defs) # nothing may be missing
  endif()
  set_target_properties(apsm PROPERTIES VERSION ${PROJECT_VERSION} SOVERSION 0)
  # The same for our own programs and tests, which also use what the shared library hides.
  add_library(apsm_inside STATIC ${objects})
  target_link_libraries(apsm_inside PUBLIC ${APSM_LINK})
endmacro()
