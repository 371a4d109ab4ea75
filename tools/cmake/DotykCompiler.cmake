# Flags of our own sources, on targets. Never -Ofast or -ffast-math: results repeat to the bit and NaN means something.
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Release, Debug, Asan or Tsan" FORCE)
endif()
set(CMAKE_Fortran_FLAGS_RELEASE "-O3 -g1")
set(CMAKE_C_FLAGS_RELEASE "-O3 -g1")
set(CMAKE_Fortran_FLAGS_DEBUG "-O1 -g -fcheck=all,no-array-temps -ffpe-trap=invalid,zero,overflow -finit-real=snan -finit-integer=-99999999 -fbacktrace")
set(CMAKE_C_FLAGS_DEBUG "-O1 -g")
set(CMAKE_Fortran_FLAGS_ASAN "-O1 -g -fsanitize=address,undefined -fno-omit-frame-pointer -fbacktrace")
set(CMAKE_C_FLAGS_ASAN "-O1 -g -fsanitize=address,undefined -fno-omit-frame-pointer")
set(CMAKE_EXE_LINKER_FLAGS_ASAN "-fsanitize=address,undefined")
set(CMAKE_Fortran_FLAGS_TSAN "-O1 -g -fsanitize=thread -fno-omit-frame-pointer")
set(CMAKE_C_FLAGS_TSAN "-O1 -g -fsanitize=thread -fno-omit-frame-pointer")
set(CMAKE_EXE_LINKER_FLAGS_TSAN "-fsanitize=thread")

function(dotyk_compile_options target)
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:Fortran>:-std=f2018 -Wall -Wextra -Wimplicit-interface -Wimplicit-procedure -Wno-maybe-uninitialized>
    $<$<COMPILE_LANGUAGE:C>:-std=c11 -Wall -Wextra>)
  target_link_libraries(${target} PRIVATE OpenMP::OpenMP_Fortran OpenMP::OpenMP_C)
endfunction()
