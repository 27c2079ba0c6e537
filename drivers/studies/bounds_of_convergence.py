"""Part of study_convergence.py: bounds of the iterations of each part."""
import numpy as np

ACCELERATION, NEWTON, LARGE, METHODS = "doc/acceleration.md", "doc/newton.md", "doc/large_scenes.md", "doc/methods.md"
#: true errors where a solve ends, over the accuracy of 0.1
GOAL = 0.1
#: iterations after which plain ones end
MOST_PLAIN = 4500
#: iterations to a true error of 0.1 for each diameter of height, and how much more is accepted
EACH, MORE = 5.0, 1.5
CRITERION = "the criterion of the solve"


def count(row, goal):
    """Iterations to a velocity error; infinitely many where it is not reached."""
    return np.inf if row[f"to error {goal:g}"] == "-" else float(row[f"to error {goal:g}"])


def ratio(one, other):
    """Of two numbers of iterations; nan where both are infinite."""
    return one / other if min(one, other) < np.inf else np.nan


def add_pairs(table, name, rows, least):
    """Plain and accelerated rows of one scene, and the program."""
    plain, momentum = (next(row for row in rows if row["by"] == by) for by in ("plain", "momentum"))
    # plain iterations that end before the error is reached are so many at least
    table.add(f"{name}: plain over accelerated iterations to an error of 0.1", ratio(min(count(plain, 0.1), MOST_PLAIN), count(momentum, 0.1)),
              least, None,
              f"{ACCELERATION}: 6 to 28; a quarter less")
    table.add(f"{name}: estimate where the program ends", momentum["program: error"] if momentum["program: converged"] else np.nan,
              None, GOAL,
              CRITERION)


def of_momentum(table, rows):
    for scene, friction in dict.fromkeys((row["scene"], row["friction"]) for row in rows):
        add_pairs(table, f"{scene}, friction {friction}",
                  [row for row in rows if (row["scene"], row["friction"]) == (scene, friction)], 4.5)


def of_heights(table, rows):
    ends = [row for row in rows if row["by"] == "momentum"]
    sweeps = {row["high"]: {by: row[f"{by}: sweeps to true error 0.1"] for by in ("momentum", "program")} for row in ends}
    low, high = min(sweeps), max(sweeps)
    for by in ("momentum", "program"):
        found = {k: np.inf if value[by] == "-" else float(value[by]) for k, value in sweeps.items()}
        table.add(f"{by}: growth of the sweeps to a true error of 0.1 from {low} to {high} cells, over that of the height",
                  found[high] / found[low] / (high / low), None, 1.1,
                  f"{ACCELERATION}, Heights: in proportion to the height; a tenth")
        table.add(f"{by}: sweeps to a true error of 0.1 for each diameter of height, the most",
                  max(found[k] / (0.65 * k) for k in found), None,
                  MORE * EACH, f"{ACCELERATION}, Heights: {EACH:g}; half more, for packings of other widths")
    for row in ends:
        table.add(f"{row['high']} cells high: true error where the program ends", row["true error at the end"], None, GOAL,
                  CRITERION)


def of_subdomains(table, rows):
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == scene]
        for parts in dict.fromkeys(row["subdomains"] for row in own):
            add_pairs(table, f"{scene} in {parts} subdomains", [row for row in own if row["subdomains"] == parts], 4.5)
        by_parts = {row["subdomains"]: count(row, 0.1) for row in own if row["by"] == "momentum"}
        most = max(by_parts)
        table.add(f"{scene}: accelerated iterations to an error of 0.1 in {most} subdomains over those in 1",
                  ratio(by_parts[most], by_parts[1]),
                  None, 1.65, f"{ACCELERATION}, Subdomains: by half on disks, by a quarter on spheres; a tenth more")


def of_methods(table, rows):
    for scene in dict.fromkeys(row["scene"] for row in rows):
        found = {row["method"]: count(row, 0.1) for row in rows if row["scene"] == scene and row["by"] == "momentum"}
        table.add(f"{scene}: accelerated NSCDD-EP over NSCDD, iterations to an error of 0.1",
                  ratio(found["nscdd_ep"], found["nscdd"]), None, 1.0,
                  f"{METHODS}: 38 and 125, 18 and 50")
        table.add(f"{scene}: Newton over NSCDD, iterations to an error of 0.1", ratio(found["newton"], found["nscdd"]), None, 1.0,
                  f"{METHODS}: the sweeps of NSCDD down to these errors")


def of_warm(table, rows):
    for scene, ends_by in dict.fromkeys((row["scene"], row["ends by"]) for row in rows):
        found = {row["by"]: row for row in rows if (row["scene"], row["ends by"]) == (scene, ends_by)}
        table.add(f"{scene}, steps that end by {ends_by}: accelerated over plain iterations",
                  found["momentum"]["iterations"] / found["plain"]["iterations"], None, 1.0,
                  f"{ACCELERATION}, Warm steps: 0.15 to 0.67")
        if ends_by.startswith("error"):
            table.add(f"{scene}, steps that end by {ends_by}: mean estimate of accelerated solves", found["momentum"]["mean error"],
                      None,
                      float(ends_by.split()[1]), CRITERION)


def of_newton(table, rows):
    # at a friction of 0.8 the page has solves that do not end
    for friction, ends_by in dict.fromkeys((row["friction"], row["ends by"]) for row in rows if row["friction"] <= 0.5):
        found = {row["method"]: row for row in rows if (row["friction"], row["ends by"]) == (friction, ends_by)}
        what = f"friction {friction}, {ends_by}"
        for method, row in found.items():
            table.add(f"{what}: estimate where {method} ends", row["error"] if row["converged"] else np.nan, None,
                      float(ends_by.split()[1]),
                      CRITERION)
        table.add(f"{what}: iterations of newton over those of nlgs", found["newton"]["iterations"] / found["nlgs"]["iterations"],
                  None, 1.0,
                  f"{NEWTON}: the same, or fewer")


def of_large(table, rows):
    for row in rows:
        if row["ends by"].startswith("error") and row["by"] != "plain":
            table.add(f"step {row['step']} by {row['by']}: estimate at the end", row["error"] if row["converged"] else np.nan, None,
                      GOAL, CRITERION)
    found = {by: sum(row["iterations"] for row in rows if row["by"] == by and row["ends by"].startswith("error"))
             for by in ("plain", "momentum")}
    table.add("accelerated over plain iterations of all steps to an error of 0.1", found["momentum"] / found["plain"], None, 1.0,
              f"{LARGE}: 908 and 14 630")


#: by part
BOUNDS = {"momentum": of_momentum, "heights": of_heights, "subdomains": of_subdomains, "methods": of_methods, "warm": of_warm,
          "newton": of_newton,
          "large": of_large}
