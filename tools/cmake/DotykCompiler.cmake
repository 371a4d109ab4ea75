# Flags of our own sources. Never -Ofast or -ffast-math: results repeat to the bit and NaN means something.
# gfortran is the reference; other compilers get the standard, warnings and CMake's own flags of Release and Debug.
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Release, Debug, Asan, Tsan or Coverage" FORCE)
endif()

if(CMAKE_Fortran_COMPILER_ID STREQUAL "GNU")
  set(CMAKE_Fortran_FLAGS_RELEASE "-O3 -g1")
  set(CMAKE_Fortran_FLAGS_DEBUG "-O1 -g -fcheck=all,no-array-temps -ffpe-trap=invalid,zero,overflow -finit-real=snan -finit-integer=-99999999 -fbacktrace")
  set(CMAKE_Fortran_FLAGS_ASAN "-O1 -g -fsanitize=address,undefined -fno-omit-frame-pointer -fbacktrace")
  set(CMAKE_Fortran_FLAGS_TSAN "-O1 -g -fsanitize=thread -fno-omit-frame-pointer")
  set(CMAKE_Fortran_FLAGS_COVERAGE "-O1 -g --coverage -fprofile-update=atomic")
  set(dotyk_fortran_flags -std=f2018 -fimplicit-none -Wall -Wextra -Wimplicit-interface -Wimplicit-procedure
      -Wno-maybe-uninitialized -Wno-uninitialized) # gfortran 12 warns of descriptors that it sets itself; preset debug finds real ones
elseif(CMAKE_Fortran_COMPILER_ID STREQUAL "LLVMFlang")
  set(dotyk_fortran_flags -std=f2018)
elseif(CMAKE_Fortran_COMPILER_ID MATCHES "^Intel")
  set(dotyk_fortran_flags -stand f18 -warn all)
endif()

if(CMAKE_C_COMPILER_ID MATCHES "GNU|Clang")
  set(CMAKE_C_FLAGS_RELEASE "-O3 -g1")
  set(CMAKE_C_FLAGS_DEBUG "-O1 -g")
  set(CMAKE_C_FLAGS_ASAN "-O1 -g -fsanitize=address,undefined -fno-omit-frame-pointer")
  set(CMAKE_C_FLAGS_TSAN "-O1 -g -fsanitize=thread -fno-omit-frame-pointer")
  set(CMAKE_C_FLAGS_COVERAGE "-O1 -g --coverage -fprofile-update=atomic")
  set(dotyk_c_flags -Wall -Wextra -ffp-contract=off)
endif()
set(CMAKE_EXE_LINKER_FLAGS_ASAN "-fsanitize=address,undefined")
set(CMAKE_EXE_LINKER_FLAGS_TSAN "-fsanitize=thread")
set(CMAKE_EXE_LINKER_FLAGS_COVERAGE "--coverage")

# dotyk_compile_options(target): the flags of a target of ours, and OpenMP.
function(dotyk_compile_options target)
  set_target_properties(${target} PROPERTIES C_STANDARD 11 C_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE
    "$<$<COMPILE_LANGUAGE:Fortran>:${dotyk_fortran_flags}>" "$<$<COMPILE_LANGUAGE:C>:${dotyk_c_flags}>")
  target_link_libraries(${target} PRIVATE OpenMP::OpenMP_Fortran OpenMP::OpenMP_C)
endfunction()
