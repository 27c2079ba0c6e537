"""The sieve curve: the part of the mass that passes, against the size of the holes."""
import matplotlib.pyplot as plt
import numpy
from curve_pictures import grid, legend_above
from matplotlib.ticker import FuncFormatter, NullLocator
from palette import LINES


def draw_sieve(table, sizes):
    """A figure of the table of `gravier.sieve` with the sizes D10, D50 and D60 of `gravier.sieve_sizes`."""
    figure, axes = plt.subplots(figsize=(6.2, 3.6), constrained_layout=True)
    low, high = table.size[0], table.size[-1]
    # one size is a step
    size = table.size if high > low else numpy.array([0.8, 1.0, 1.0, 1.25]) * low
    axes.plot(size, table.passing if high > low else [0.0, 0.0, 100.0, 100.0], color=LINES[0], linewidth=1.4, label=f"$C_u$ = {sizes.C_u[0]:.3g}")
    for k, name in enumerate(("D10", "D50", "D60"), 1):
        axes.plot(sizes[name], [float(name[1:])], "o", color=LINES[k], markersize=5, label=f"{name} = {sizes[name][0]:.3g} m")
    axes.set(xscale="log", xlabel="size [m]", ylabel="passing by mass [%]", ylim=(0.0, 105.0))
    if axes.get_xlim()[1] < 20.0 * axes.get_xlim()[0]:
        # no power of ten lies within
        low, high = axes.get_xlim()
        axes.set_xticks([float(f"{tick:.2g}") for tick in numpy.geomspace(low, high, 7)[1:-1]])
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlim(low, high)
    grid(axes)
    legend_above(axes, columns=4)
    return figure
