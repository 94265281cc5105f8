"""The sections that tools/measure knows: name -> function, and what each needs."""

from measuring import accuracy, bricks, gpu_peers, paper, speed
from measuring.run import AS_CPU

SECTIONS = {
    section.__name__: section
    for section in (
        speed.frames,
        speed.normals,
        speed.ambient,
        speed.scenes,
        speed.speculation,
        speed.slots,
        speed.budgets,
        speed.sweep,
        speed.levels,
        speed.storage,
        speed.error,
        speed.time,
        speed.kernels,
        accuracy.watertight,
        accuracy.stability,
        speed.cpus,
        speed.peer,
        gpu_peers.gpu_peer,
        paper.paper,
        paper.devices,
        bricks.bricks_weak,
        bricks.bricks_strong,
        bricks.bricks_exact,
        bricks.bricks_large,
        bricks.bricks_alone,
        accuracy.bits,
        accuracy.oracles,
        accuracy.certified,
        accuracy.sizes,
        accuracy.detail,
        accuracy.solvers,
        accuracy.pareto,
        accuracy.pareto_large,
        accuracy.vtk,
        accuracy.topology,
    )
}
# Names of --only that stand for several.
GROUPS = {"bricks": bricks.PARTS}
NEED_VOLUMES = (
    "bits",
    "oracles",
    "certified",
    "sizes",
    "detail",
    "solvers",
    "pareto",
    "topology",
    "vtk",
)
# What some need beside isowave, frame_bench and isowave_bench: built only with VTK, with CUDA, with
# MPI, or with tests.
PROGRAMS = {
    "peer": "bench/peer_bench",
    "gpu_peer": "bench/gpu_peer",
    **{name: "bench/brick_bench" for name in (*bricks.PARTS, "bricks_alone")},
    "cpus": AS_CPU,
}
