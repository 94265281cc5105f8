"""How tables show numbers and names."""


def ms(value):
    return f"{value:.2f}" if value < 20 else f"{value:,.0f}"


def percent(part):
    return f"{100 * part:.1f} %"


def mebibytes(count):
    return f"{count / 2**20:,.0f} MiB"


def name_of(field):
    """mixing_layer_512x512x512 -> mixing layer 512^3"""
    name, dims = field.rsplit("_", 1)
    sides = dims.split("x")
    cube = len(set(sides)) == 1
    return f"{name.replace('_', ' ')} {sides[0] + '^3' if cube else ' x '.join(sides)}"
