"""The numbers of the rover in MuJoCo that no rover profile holds, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass, fields

from rover_iface.errors import RoverError


@dataclass(frozen=True, slots=True)
class VehicleOptions:
    """Masses, soil and motors. All are positive; `friction_cv` may be 0.

    Attributes
    ----------
    gravity_m_s2
        That of Mars, as the planner has it.
    wheel_share, rocker_share, bogie_share
        Mass of one as a share of the rover's. A wheel of the Mars Exploration Rovers with its motors is 3 to
        4 % of the 176 kg; rockers and bogies are estimates.
    mass_height
        Height of the body's centre of mass above its underside, as a share of the body's height: an estimate
        that leaves K9 upright up to 37 degrees, more than its profile lets it tilt.
    friction, friction_cv
        Of wheels on ground, mean and spread of the log-normal that a seed draws from. Loose to dense dry
        sand has a friction angle of 30 to 35 degrees, tangent 0.58 to 0.70.
    rolling_resistance
        Share of a wheel's load that it takes to roll on level ground; wheels on sand have 0.1 to 0.2
        (Wong, Theory of Ground Vehicles). It acts in the wheel: it costs work, and no grip.
    torque_reserve
        How many times the torque a wheel needs on the steepest slope of the profile its motor can give; steps
        as high as the wheel take about four times that.
    drive_efficiency
        Of motor and gear together: planetary gears of four stages leave 0.6, a brushed motor 0.7 of that.
    electronics_w
        Amplifiers of ten motors while the rover drives, 1.5 W each: an estimate.
    step_s
        Of the dynamics. At 4 ms wheels do not yet sink through ground; research rovers are run at 2 to 5 ms.
    spacing_m
        Least distance between posts of the ground; half a wheel's radius needs no finer ones.
    """

    gravity_m_s2: float = 3.71
    wheel_share: float = 0.035
    rocker_share: float = 0.04
    bogie_share: float = 0.02
    mass_height: float = 0.2
    friction: float = 0.65
    friction_cv: float = 0.15
    rolling_resistance: float = 0.12
    torque_reserve: float = 4.0
    drive_efficiency: float = 0.42
    electronics_w: float = 15.0
    step_s: float = 0.004
    spacing_m: float = 0.05

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (value > 0 or (each.name == "friction_cv" and value == 0)):
                raise RoverError(f"vehicle option {each.name} is {value}; it must be positive")


@dataclass(frozen=True, slots=True)
class PilotOptions:
    """How the rover follows a path, and when it gives up.

    Attributes
    ----------
    tick_s
        Time between two commands to the wheels.
    report_s
        Length of a step of the action: how finely tilt, battery and progress are looked at.
    look_ahead_m
        Distance along the path of the point that is steered for; about the wheelbase.
    turn_first_rad
        Beyond this the rover turns in place instead of along an arc.
    arrived_m, arrived_rad, beside_m
        So near is at the goal; a goal that was passed by no more than `beside_m` counts as reached, too. The
        arm corrects what is left.
    window_s, least_share
        A drive that over `window_s` comes to less than `least_share` of what was commanded is over.
    patience, patience_s
        Time limit of a drive: so many times what it takes by speed and turn rate, and so long besides.
    """

    tick_s: float = 0.1
    report_s: float = 1.0
    look_ahead_m: float = 0.8
    turn_first_rad: float = 0.4
    arrived_m: float = 0.05
    arrived_rad: float = 0.03
    beside_m: float = 0.15
    window_s: float = 40.0
    least_share: float = 0.1
    patience: float = 4.0
    patience_s: float = 120.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not value > 0:
                raise RoverError(f"pilot option {each.name} is {value}; it must be positive")
