// Carries the precompiled header of the targets without LibTorch; see cmake/Q3dTargets.cmake.
