#!/usr/bin/env python3
"""Draw bench_kernels and bench_step (png and svg) from the table of gravier_bench: rates of the kernels against what the
bandwidth of memory allows, and a step by phase. With --markdown print the tables of doc/performance.md instead."""
import argparse
import csv
import sys
from pathlib import Path

try:
    import matplotlib
except ImportError as missing:
    sys.exit(f"plot_bench.py: {missing}; expected a python3 with matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import save_figure  # noqa: E402

# where the data of a problem lie, from fast to slow; one colour each (Okabe and Ito, safe for the colour-blind)
PLACES = {"kernel_core_cache": ("caches of the core", "#56B4E9"), "kernel_last_cache": ("last cache", "#009E73"),
          "kernel_memory": ("memory", "#0072B2")}
PHASES = {"share_sweeps": ("sweeps", "#0072B2"), "share_exchange": ("exchange", "#56B4E9"), "share_checks": ("checks", "#E69F00"),
          "share_reductions": ("reductions", "#8B4513"),
          "share_detection": ("detection", "#D55E00"), "share_lists_and_ghosts": ("lists and ghosts", "#CC79A7"),
          "share_setup": ("set-up", "#F0E442"), "share_bodies": ("bodies", "#009E73"), "share_rest": ("rest", "#999999")}
DETECTION = ["list_build", "list_check_and_ghosts", "contact_search", "contact_packing", "interface_search"]
STEPS = {"step": "NLGS", "strong_scaling": "NSCDD", "weak_scaling": "NSCDD, weak"}


def read(path):
    """{(group, case, size, ranks): {quantity: (median, low, high)}}, in the order of the table, and what it ran on."""
    rows, machine = {}, ""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                case = rows.setdefault((row["group"], row["case"], int(row["size"]), int(row["ranks"])), {})
                case[row["quantity"]] = tuple(float(row[name]) for name in ("median", "low", "high"))
                machine = f"{row['machine']}, {row['compiler']}, Gravier {row['version']} ({row['revision']}), {row['date']}"
    except OSError as reason:
        sys.exit(f"plot_bench.py: {path}: {reason.strerror}; expected the table of gravier_bench")
    except (KeyError, ValueError) as reason:
        sys.exit(f"plot_bench.py: {path}: {reason}; expected the table of gravier_bench")
    return rows, machine


def draw_kernels(rows, axes):
    """A bar a kernel and place of its data, from the least to the greatest value a line, and the limit of memory."""
    bandwidth = next(case["bandwidth"][0] for (group, _, _, ranks), case in rows.items() if group == "triad" and ranks == 1)
    names = list(dict.fromkeys(name for group, name, _, _ in rows if group == "kernel_memory"))
    width = 0.8 / len(PLACES)
    for k, (place, (label, colour)) in enumerate(PLACES.items()):
        cases = {name: case for (group, name, _, _), case in rows.items() if group == place}
        x = [n + (k - 1) * width for n in range(len(names))]
        values = [[value / 1e6 for value in cases[name]["relaxations"]] for name in names]
        axes.bar(x, [v[0] for v in values], width, color=colour, label=f"data in {label}")
        axes.vlines(x, [v[1] for v in values], [v[2] for v in values], color="0.2", linewidth=0.8)
        if place == "kernel_memory":
            limits = [bandwidth / cases[name]["bytes_per_relaxation"][0] / 1e6 for name in names]
            axes.hlines(limits, [n - 0.45 for n in range(len(names))], [n + 0.45 for n in range(len(names))], color="#D55E00",
                        label="triad over bytes streamed")
    axes.set_xticks(range(len(names)), [name.replace("_", " ") for name in names], fontsize=7, rotation=40, ha="right", rotation_mode="anchor")
    axes.set_ylabel("relaxations [10$^6$/s], one core")
    axes.legend(frameon=False, fontsize=8)
    axes.grid(True, axis="y", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)


def draw_steps(rows, axes):
    """A bar a scene: shares of the phases of its step, the iterations being those of the run."""
    cases = {key: case for key, case in rows.items() if key[0] in STEPS and "share_sweeps" in case}
    bottom = [0.0] * len(cases)
    for phase, (label, colour) in PHASES.items():
        shares = [100 * case[phase][0] for case in cases.values()]
        axes.bar(range(len(cases)), shares, 0.7, bottom=bottom, color=colour, label=label)
        bottom = [low + share for low, share in zip(bottom, shares)]
    axes.set_xticks(range(len(cases)), [f"{STEPS[group]}\n{size} spheres\n{ranks} rank{'s' * (ranks > 1)}"
                                        for group, _, size, ranks in cases], fontsize=6)
    axes.set_ylabel("share of a step [%]")
    axes.set_ylim(0, 100)
    axes.legend(frameon=False, fontsize=8, ncol=1, loc="center left", bbox_to_anchor=(1.0, 0.5))


def table(head, lines):
    """A table in Markdown, numbers to the right."""
    print("| " + " | ".join(head) + " |")
    print("|" + "|".join("---" if k == 0 else "---:" for k in range(len(head))) + "|")
    for line in lines:
        print("| " + " | ".join(line) + " |")
    print()


def text(value, scale=1.0, digits=3):
    """Median, and in brackets the least and the greatest value, with so many significant digits."""
    return "{} [{}, {}]".format(*(f"{float(f'{scale * number:.{digits}g}'):.12g}" for number in value))


def print_tables(rows, machine):
    print(machine + "\n")
    table(["triad", "elements of an array", "GB/s"],
          [[f"on {ranks} core{'s at once' if ranks > 1 else ''}", str(size), text(case["bandwidth"], 1e-9)]
           for (group, _, size, ranks), case in rows.items() if group == "triad"])
    places = {place: {name: (size, case) for (group, name, size, _), case in rows.items() if group == place} for place in PLACES}
    table(["kernel", "bytes a relaxation", *(f"10^6 relaxations/s, {label}" for label, _ in PLACES.values()),
           "contacts in memory", "bytes a second over triad"],
          [[f"`{name}`", f"{case['bytes_per_relaxation'][0]:.0f}",
            *(text(cases[name][1]["relaxations"], 1e-6) for cases in places.values()), str(size),
            text(case["ratio_to_triad"], digits=2)]
           for name, (size, case) in places["kernel_memory"].items()])
    table(["effect", "unknowns", "bytes a contact", "times the bytes without it", "ns a relaxation", "times the time without it"],
          [[f"`{name}`", f"{case['unknowns'][0]:.0f}", f"{case['bytes_per_contact'][0]:.0f}", f"{case['bytes_over_without'][0]:.2f}",
            text(case["seconds_per_relaxation"], 1e9), text(case["seconds_over_without"])]
           for (group, name, _, _), case in rows.items() if group == "effect"])
    table(["one exchange", "spheres", "ranks", "ms", "shared bodies", "numbers of all copies", "ns a number"],
          [[name, str(size), str(ranks), text(case["exchange"], 1e3), f"{case['shared_bodies'][0]:.0f}",
            f"{case['copies_values'][0]:.0f}", text(case["seconds_per_value"], 1e9)]
           for (group, name, size, ranks), case in rows.items() if group == "exchange"])
    table(["interface", "unknowns", "ranks", "factors [ms]", "one solve [ms]", "iterations"],
          [[name, str(size), str(ranks), text(case["factorisation"], 1e3), text(case["interface_solve"], 1e3),
            f"{case['iterations'][0]:.1f}" if "iterations" in case else ""]
           for (group, name, size, ranks), case in rows.items() if group == "interface"])
    table(["detection", *("ns a grain: " + name.replace("_", " ") for name in DETECTION)],
          [[f"{size} spheres"] + [text(case[name], 1e9) for name in DETECTION]
           for (group, _, size, _), case in rows.items() if group == "step"])
    steps = {key: case for key, case in rows.items() if key[0] in STEPS and "share_sweeps" in case}
    table(["step", "spheres", "contacts", "ranks", "iterations", "step [s]", "solve [s]", "ns a contact and iteration"],
          [[STEPS[group], str(size), f"{case['contacts'][0]:.0f}", str(ranks), f"{case['iterations'][0]:.0f}", text(case["step"]),
            text(case["solve"]), text(case["solve_per_contact_iteration"], 1e9)]
           for (group, _, size, ranks), case in steps.items()])
    table(["share of the step [%]", "spheres", "ranks", *(label for label, _ in PHASES.values()), "a list made anew",
           "a state written"],
          [[STEPS[group], str(size), str(ranks), *(f"{100 * case[phase][0]:.1f}" for phase in PHASES),
            f"{100 * case['list_build_over_step'][0]:.1f}",
            f"{100 * case['write_state_over_step'][0]:.1f}" if "write_state_over_step" in case else ""]
           for (group, _, size, ranks), case in steps.items()])
    table(["scaling", "spheres", "ranks", "solve", "step"],
          [[label, str(size), str(ranks), text(case[ratio + "_solve"]), text(case[ratio + "_step"])]
           for key, label, ratio in (("strong_scaling", "strong: times as fast as 1 rank", "speedup"),
                                     ("weak_scaling", "weak: efficiency", "efficiency"))
           for (group, _, size, ranks), case in rows.items() if group == key and ratio + "_step" in case])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path, metavar="CSV", help="the table of gravier_bench")
    parser.add_argument("--out", type=Path, default=Path("."), metavar="DIR", help="where the figures go (.)")
    parser.add_argument("--markdown", action="store_true", help="print tables, draw nothing")
    options = parser.parse_args()
    rows, machine = read(options.table)
    if not any(group == "triad" for group, *_ in rows):
        sys.exit(f"plot_bench.py: {options.table}: no row of the group triad; expected the table of gravier_bench")
    if options.markdown:
        print_tables(rows, machine)
        return
    options.out.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({"font.size": 9, "svg.hashsalt": "gravier", "svg.fonttype": "none"})
    for name, draw in (("bench_kernels", draw_kernels), ("bench_step", draw_steps)):
        figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
        draw(rows, axes)
        figure.supxlabel(machine, fontsize=6)
        save_figure(figure, options.out / f"{name}.png", dpi=200, metadata={"Software": None})
        save_figure(figure, options.out / f"{name}.svg", metadata={"Date": None, "Creator": None})
        plt.close(figure)


if __name__ == "__main__":
    main()
