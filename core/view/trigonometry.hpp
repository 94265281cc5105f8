#pragma once
// Functions of angles with the same bits on every system. Those of C libraries differ in their last
// bit, and so do cameras, directions of light and pictures that follow from it.

namespace isowave::core {

/// Rounded from about 100 bits: the nearest double, but for one angle in 2^40 or so.
///
/// angle  radians; from about 10^8 turns on, the C library's function is called
double sine(double angle);
double cosine(double angle);
double tangent(double angle);
/// Radians, -pi/2 to pi/2. Rounded likewise; from 10^9 on, the C library's function is called.
double arc_tangent(double value);

}  // namespace isowave::core
