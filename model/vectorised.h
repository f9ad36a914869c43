// A macro for functions with numeric loops. They are compiled for several instruction sets, and the program
// chooses the processor's when it starts.
#pragma once

// Put the macro before such a function. Loops are vectorised only at O3, and a loop with a square root only
// with no-math-errno, because the root could otherwise set errno. Clang writes such a list in another way;
// there, the function is compiled once.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define Q3D_VECTORISED \
  __attribute__((target_clones("default", "avx2,fma", "avx512f"), optimize("O3", "no-math-errno")))
#else
#define Q3D_VECTORISED
#endif
