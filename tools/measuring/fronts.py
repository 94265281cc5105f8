"""What charts and tables of `isowave bench` share: fronts, and names of volumes."""

# A point is on the front if it has less of the error than all cheaper ones, by this factor at
# least: points beside each other would hide each other's names.
LEAST_GAIN = 0.95
# Two ways are alike if cost and error differ by less than these factors, which noise explains. The
# one that is listed first, which has fewer options, then stands for both.
ALIKE_COST, ALIKE_ERROR = 1.1, 1.02


def front_of(points, cost, error):
    """The points that no other point beats, the cheapest first.

    cost, error: names of the values in the points
    """
    points = list(points)
    front = []
    for point in sorted(points, key=lambda point: (point[cost], point[error])):
        if not front or point[error] < LEAST_GAIN * front[-1][error]:
            most, worst = ALIKE_COST * point[cost], ALIKE_ERROR * point[error]
            front.append(next(p for p in points if p[cost] <= most and p[error] <= worst))
    return front


def volume_title(document):
    """Such as "bonsai, 256\u00b3, isovalue 40"."""
    name = document["volume"].rsplit("/", 1)[-1].removeprefix("generate:")
    for end in ("_", "."):
        name = name.split(end + str(document["dims"][0]))[0].split(".")[0]
    dims = document["dims"]
    size = f"{dims[0]}\u00b3" if len(set(dims)) == 1 else "x".join(str(dim) for dim in dims)
    return f"{name.replace('_', ' ')}, {size}, isovalue {document['isovalue']:g}"
