// Carries a precompiled header; see cmake/Q3dTargets.cmake.
