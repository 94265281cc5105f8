/// solver.h -- the family of root finders behind one contract, for the field along a ray's segment
/// in one cell. Portable: OpenCL C 1.2 and C++; kernels and the scalar twin run these very lines.
///
/// Contract: the cubic is the field minus the isovalue on s in [0,1], entry to exit. isolate()
/// returns 1 and a bracket of the first s at which inside (value >= 0) differs from inside at s =
/// 0; 0 if it never does. refine() places the root in the bracket with at most max_steps steps; 0
/// leaves the first guess. They are apart so that a work-group's rays refine together after their
/// walks, not one by one in the midst of the others' walks. Above each solver stands what it keeps
/// of that contract:
///
///   solver      misses                                  refinement          cost
///   linear      every even number of crossings          false position      least
///   marmitt     extrema lost to its naive quadratic     false position      low
///   analytic    roots lost to cancellation              none (closed form)  most: cbrt, acos
///   bernstein   nothing above rounding of entry, exit   bracketed Newton    low
///
/// A kernel is built for one solver (-D ISO_SOLVER, -D ISO_ROOT_STEPS); the twin takes it as a
/// value.
#ifndef ISOWAVE_SOLVER_H
#define ISOWAVE_SOLVER_H

#include "cubic.h"
#include "solve_analytic.h"
#include "solve_bernstein.h"
#include "solve_linear.h"
#include "solve_marmitt.h"

ISO_NAMESPACE_BEGIN

#define ISO_SOLVER_LINEAR 0
#define ISO_SOLVER_MARMITT 1
#define ISO_SOLVER_ANALYTIC 2
#define ISO_SOLVER_BERNSTEIN 3

typedef struct Solver {
  int kind;       ///< ISO_SOLVER_*
  int max_steps;  ///< refinement steps at most, 0..64
} Solver;

/// See the contract above; or ISO_DOUBTFUL (`bernstein` alone): isolate_precisely() then decides.
ISO_INLINE int isolate(Solver solver, Cubic c, Bracket *bracket) {
  switch (solver.kind) {
    case ISO_SOLVER_LINEAR:
      return isolate_linear(c, bracket);
    case ISO_SOLVER_MARMITT:
      return isolate_marmitt(c, bracket);
    case ISO_SOLVER_ANALYTIC:
      return isolate_analytic(c, bracket);
    default:
      return isolate_bernstein(c, bracket);
  }
}

ISO_INLINE float refine(Solver solver, Cubic c, Bracket bracket) {
  float s = bracket.lo;
  if (bracket.lo != bracket.hi) {
    s = solver.kind == ISO_SOLVER_BERNSTEIN ? refine_by_newton(c, bracket, solver.max_steps)
                                            : refine_by_chords(c, bracket, solver.max_steps);
  }
  return s > 0.0f ? s : 0.0f; /* no -0, whose sign compilers may change */
}

/// Both, for a cubic of which no more than its float coefficients is known: the first s at which
/// inside differs from inside at s = 0. Returns 0 if it never does.
ISO_INLINE int first_change(Solver solver, Cubic c, float *s) {
  Bracket bracket;
  int found = isolate(solver, c, &bracket);
  if (found == ISO_DOUBTFUL) found = isolate_precisely(widened(c), c, &bracket);
  if (found) *s = refine(solver, c, bracket);
  return found;
}

ISO_NAMESPACE_END

#endif
