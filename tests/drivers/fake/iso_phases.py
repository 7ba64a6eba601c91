"""The pulsation phases of the simulated vacuum, which its trapezoid makes known exactly."""

from grabberd_fake.liner_options import EllipseOptions


def iso_phases_s(options: EllipseOptions) -> tuple[float, float, float, float]:
    """Durations of a, b, c, d by thresholds 4 kPa over atmosphere and 4 kPa under the system's vacuum."""
    vacuum = options.vacuum
    steep = (vacuum.system_kpa - 8) / vacuum.system_kpa
    edge = 4 / vacuum.system_kpa
    held = options.opening + options.open - vacuum.closing_lag + vacuum.opening_lag - vacuum.rising
    a, c = vacuum.rising * steep, vacuum.falling * steep
    b = held + (vacuum.rising + vacuum.falling) * edge
    return (
        a * options.period_s,
        b * options.period_s,
        c * options.period_s,
        (1 - a - b - c) * options.period_s,
    )
