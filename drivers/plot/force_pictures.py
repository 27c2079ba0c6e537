"""Forces between grains: their distribution, and roses of contacts and forces by direction."""
import matplotlib.pyplot as plt
import numpy
from curve_pictures import grid, legend_above
from palette import LINES, SHADES
from picture_style import PictureError

from gravier.force_networks import STRONG


def draw_forces(distribution, directions, beta, dimension):
    """A figure of the tables of `force_distribution` and `force_directions`: the probability density of forces over their mean with the exponential of strong
    normal forces, `beta`, and a rose each of contacts, normal and, where there are any, tangential forces with their fits."""
    if not numpy.isfinite(directions.contacts_fitted).all():
        raise PictureError(f"{int(directions['count'].sum())} contacts; expected more for a picture of their directions")
    figure = plt.figure(figsize=(6.6, 5.6), layout="constrained")
    roses = [("contacts", "contacts", directions.contacts, directions.contacts_fitted),
             ("normal forces", "over their mean", directions.normal, directions.normal_fitted),
             ("tangential forces", "over the normal mean, light below 0", directions.tangential, directions.tangential_fitted)]
    if not numpy.nan_to_num(directions.tangential).any():
        # without friction there is none
        del roses[2]
    rows = figure.add_gridspec(2, len(roses), height_ratios=(1.15, 1.0))
    draw_distribution(figure.add_subplot(rows[0, :]), distribution, beta)
    for k, (name, unit, values, fitted) in enumerate(roses):
        axes = figure.add_subplot(rows[1, k], projection="polar")
        draw_rose(axes, numpy.radians(directions.angle), values, fitted, LINES[(2, 0, 1)[k]], dimension)
        axes.set_title(name if name == unit else f"{name}\n{unit}", fontsize=9)
    return figure


def draw_distribution(axes, rows, beta):
    for name, label, colour, mark in (("normal", "normal forces", LINES[0], "o"), ("tangential", "sizes of tangential forces", LINES[1], "s")):
        there = rows[name] > 0.0
        if not there.any():
            continue
        axes.semilogy(rows.force[there], rows[name][there], mark, color=colour, markersize=4, label=label)
    strong = (rows.force > STRONG[0]) & (rows.force < STRONG[1]) & (rows.normal > 0.0)
    if numpy.isfinite(beta) and strong.any():
        # through the mean of the logarithms of the strong forces, each as often as it was found
        level = numpy.average(numpy.log(rows.normal[strong]) + beta * rows.force[strong], weights=rows.contacts[strong])
        ends = numpy.array(STRONG)
        axes.semilogy(ends, numpy.exp(level - beta * ends), "-", color="0.2", linewidth=1.1, label=f"exp(-{beta:.3g} f), fitted from {STRONG[0]:g} to {STRONG[1]:g}")
    axes.set(xlabel="force over its mean, f", ylabel="probability density", xlim=(0.0, None))
    grid(axes)
    legend_above(axes)


def draw_rose(axes, angle, values, fitted, colour, dimension):
    """Values by direction as bars, all around, and their fit as a line. Values below 0 are lighter. In space the angle is that to z, which points up."""
    width = (numpy.pi if dimension == 2 else 0.5 * numpy.pi) / len(angle)
    turns = [(1.0, 0.0), (1.0, numpy.pi)] if dimension == 2 else [(1.0, 0.0), (-1.0, 0.0), (1.0, numpy.pi), (-1.0, numpy.pi)]
    for sign, turn in turns:
        bars = axes.bar(sign * angle + turn, numpy.abs(numpy.nan_to_num(values)), width, color=colour, edgecolor="white", linewidth=0.4)
        for bar, value in zip(bars, values):
            bar.set_alpha(0.85 if not value < 0.0 else 0.35)
    around = numpy.concatenate([sign * angle[::int(sign)] + turn for sign, turn in turns])
    order = numpy.argsort(around % (2.0 * numpy.pi))
    line = numpy.abs(numpy.concatenate([fitted[::int(sign)] for sign, _ in turns]))[order]
    around = around[order] % (2.0 * numpy.pi)
    axes.plot(numpy.append(around, around[0] + 2.0 * numpy.pi), numpy.append(line, line[0]), color="0.15", linewidth=1.1)
    if dimension == 3:
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(-1)
    axes.set_thetagrids(numpy.arange(0, 360, 45), ["x", "", "y", "", "", "", "", ""] if dimension == 2 else ["z", "", "", "", "", "", "", ""])
    axes.tick_params(labelsize=7, pad=-1)
    axes.yaxis.set_major_locator(plt.MaxNLocator(3, prune="lower"))
    axes.set_rlabel_position(20.0)
    for label in axes.get_yticklabels():
        label.set(zorder=5, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.6})
    axes.grid(color=SHADES[1], linewidth=0.4)
