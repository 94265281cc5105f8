// The functions of OpenMP's runtime that libzfp calls, for one thread: isowave has libzfp code one
// row of blocks at a time, and never asks it for threads. libgomp would be a tenth of a wheel.
// Names and versions are those of own_zfp.cmake and serial_openmp.map.

void isowave_GOMP_parallel(void (*work)(void *), void *data, unsigned num_threads, unsigned flags) {
  (void)num_threads;
  (void)flags;
  work(data);
}

int isowave_omp_get_max_threads(void) {
  return 1;
}

int isowave_omp_get_num_threads(void) {
  return 1;
}

int isowave_omp_get_thread_num(void) {
  return 0;
}
