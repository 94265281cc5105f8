/// solver.h -- the family of root finders behind one contract, for the field along a ray's segment in one cell.
/// Portable: OpenCL C 1.2 and C++; kernels and the scalar twin run these very lines.
///
/// Contract of solve_*(cubic, max_steps, s): the cubic is the field minus the isovalue on s in [0,1], entry to exit.
/// Returns 1 and the first s at which inside (value >= 0) differs from inside at s = 0; 0 if it never does. max_steps
/// bounds the refinement; 0 leaves the first guess. What each keeps of that contract stands above it:
///
///   solver      misses                                  refinement          cost
///   linear      every even number of crossings          false position      least
///   marmitt     extrema lost to its naive quadratic     false position      low
///   analytic    roots lost to cancellation              none (closed form)  most: cube root, arc cosine
///   bernstein   nothing above 2^-40                     bracketed Newton    low
///
/// A kernel is built for one solver (-D ISO_SOLVER, -D ISO_ROOT_STEPS); the twin takes it as a value.
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

/// See the contract above; or ISO_DOUBTFUL (`bernstein` alone): solve_bernstein_precisely() then decides.
static inline int first_change_or_doubt(Solver solver, Cubic c, float *s) {
  switch (solver.kind) {
    case ISO_SOLVER_LINEAR:
      return solve_linear(c, solver.max_steps, s);
    case ISO_SOLVER_MARMITT:
      return solve_marmitt(c, solver.max_steps, s);
    case ISO_SOLVER_ANALYTIC:
      return solve_analytic(c, solver.max_steps, s);
    default:
      return solve_bernstein(c, solver.max_steps, s);
  }
}

/// See the contract above, for a cubic of which no more than its float coefficients is known.
static inline int first_change(Solver solver, Cubic c, float *s) {
  const int found = first_change_or_doubt(solver, c, s);
  return found == ISO_DOUBTFUL ? solve_bernstein_precisely(widened(c), c, s) : found;
}

ISO_NAMESPACE_END

#endif
