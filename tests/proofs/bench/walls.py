"""The simulated walls as solved: where they buckle and touch, and what they do to their teats."""

from collections.abc import Iterator

from grabberd_fake.wall_states import buckling_kpa, teat_load, touch_kpa, wall_names, wall_states

DIFFERENCE_KPA = 42.0


def table() -> str:
    """Every liner on every teat, as Markdown."""
    names = wall_names()
    return "\n".join(
        [
            f"At {DIFFERENCE_KPA:g} kPa over the wall. TPPD and CCPD are those of the empty liner; contact",
            "pressure is that of the pressed nodes as far as the teat reaches, load that on one side of it.",
            "",
            "| liner | CCPD, kPa | TPPD, kPa | teat | contact mean, kPa | peak, kPa | load up to, N/mm | N |",
            "|---|---|---|---|---|---|---|---|",
            *(row for name in names if name.endswith("-empty") for row in _rows(name, names)),
        ]
    )


def _rows(empty: str, names: list[str]) -> Iterator[str]:
    design = empty.removesuffix("-empty")
    buckles, touches = buckling_kpa(wall_states(empty)), touch_kpa(wall_states(empty))
    for name in names:
        if name.startswith(f"{design}-") and name != empty:
            load = teat_load(wall_states(name), DIFFERENCE_KPA)
            teat = name.removeprefix(f"{design}-")
            yield (
                f"| {design} | {buckles:.1f} | {touches:.1f} | {teat} "
                f"| {load.mean_kpa:.1f} | {load.peak_kpa:.0f} "
                f"| {load.peak_n_per_mm:.2f} | {load.force_n:.1f} |"
            )
