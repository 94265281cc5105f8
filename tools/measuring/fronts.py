"""What no other way to draw beats: fronts of `isowave bench pareto`."""

# A point is on the front if it has less of the error than all cheaper ones, by this factor at
# least: points beside each other would hide each other's names.
LEAST_GAIN = 0.95


def front_of(points, cost, error):
    """The points that no other point beats, the cheapest first.

    cost, error: names of the values in the points
    """
    front = []
    for point in sorted(points, key=lambda point: (point[cost], point[error])):
        if not front or point[error] < LEAST_GAIN * front[-1][error]:
            front.append(point)
    return front
