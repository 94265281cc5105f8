"""The sections that tools/measure knows: name -> function, and what each needs."""

from measuring import accuracy, paper, speed

SECTIONS = {
    section.__name__: section
    for section in (
        speed.frames,
        speed.normals,
        speed.ambient,
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
        paper.paper,
        accuracy.bits,
        accuracy.oracles,
        accuracy.certified,
        accuracy.sizes,
        accuracy.detail,
        accuracy.solvers,
        accuracy.pareto,
    )
}
NEED_VOLUMES = ("bits", "oracles", "certified", "sizes", "detail", "solvers", "pareto")
# Built only with -DISOWAVE_BUILD_PEER=ON.
NEED_PEER = ("peer",)
# With -DISOWAVE_BUILD_TESTS=ON, and PoCL as the device.
NEED_POCL = ("cpus",)
