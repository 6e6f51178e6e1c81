"""How fast random costs are computed: all draws of an option at once, or one by one in a loop.

Both methods get the same quantiles of the same assumptions and must give the same costs.
"""

import numpy as np
from _timing import seconds

from shipnet.design.catalogue import Assumptions, values_at
from shipnet.design.costs import CABLE_RANGES, Model, draw, quantities, tornado
from shipnet.design.plant import Plant

DRAWS = 10_000
SAMPLE = 100  # draws in the loop, whose time is scaled up
POINTS = (350, 2000)


def loop(model, levels):
    """Add up the total cost of each draw in turn, assumption by assumption."""
    names, costs = list(levels), []
    for u in np.array(list(levels.values())).T:
        at = {
            name: values_at([model.assumptions[name]], np.array([level]))[0, 0]
            for name, level in zip(names, u, strict=True)
            if name not in CABLE_RANGES
        }
        level = dict(zip(names, u, strict=True))
        money = hours = 0.0
        for cable in model.laid.itertuples():
            entry = model.cables[cable.Index]
            price, lay, end = (
                values_at([getattr(entry, CABLE_RANGES[name][0])], np.array([level[name]]))[0, 0]
                for name in ("cable_price", "laying_time", "termination_time")
            )
            length = cable.length_m * at["laid_length"]
            money += length * price
            hours += length * lay + cable.ends * end
        for name, number in model.items.items():
            if model.assumptions.entry(name).unit == "h":
                hours += number * at[name]
            else:
                money += number * at[name]
        costs.append(money + hours * at["labour_rate"])
    return costs


def main():
    names = [*CABLE_RANGES, *Assumptions()]
    for points in POINTS:
        plant = Plant(modules=points // 4, contacts=4, lines=max(1, points // 248))
        options = {"hardwired": plant.hardwired, "AS-i": plant.on_asi}
        models = {name: Model(design) for name, design in options.items()}
        some = np.random.default_rng(2024).random((len(names), SAMPLE))
        levels = dict(zip(names, some, strict=True))
        for model in models.values():
            assert np.allclose(
                loop(model, levels), model.figures(levels)["total_cost_eur"], rtol=1e-12
            )

        at_once = seconds(lambda o=options: draw(o, rng=np.random.default_rng(1), draws=DRAWS))
        one_by_one = seconds(lambda m=models, u=levels: [loop(one, u) for one in m.values()])
        one_by_one *= DRAWS / SAMPLE
        print(f"{points} points, {len(options)} options, {DRAWS} draws")
        print(f"  {'all draws at once, all figures':<36}{at_once:>9.3f} s")
        print(f"  {'draw by draw, total cost only':<36}{one_by_one:>9.3f} s", end="")
        print(f"{one_by_one / at_once:>9.0f}x")
        print(f"  {'figures of one option':<36}", end="")
        print(f"{seconds(lambda o=options: quantities(o['AS-i'])):>9.3f} s")
        print(f"  {'tornado of both options':<36}{seconds(lambda o=options: tornado(o)):>9.3f} s")


if __name__ == "__main__":
    main()
