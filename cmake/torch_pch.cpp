// Carries the precompiled LibTorch header; see cmake/Q3dTargets.cmake.
