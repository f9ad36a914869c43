// Loops over numbers of our own, compiled for several instruction sets, of which the program takes the
// processor's own when it starts.
#pragma once

// Stands before such a function. Its loops become vectors at O3 alone, and without no-math-errno a square
// root could set errno, which keeps its loop from becoming one. Clang writes such a list in another way;
// there, the function is compiled once.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define Q3D_VECTORISED \
  __attribute__((target_clones("default", "avx2,fma", "avx512f"), optimize("O3", "no-math-errno")))
#else
#define Q3D_VECTORISED
#endif
