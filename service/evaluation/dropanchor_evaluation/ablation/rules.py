"""The rules of the engine `fleet` that can be taken out, one at a time, and what takes each of them out.

A rule is taken out by other values of its numbers: fields of `Tuning`, which compiled code reads at run time, or
constants of the engine's modules, which it reads while it is compiled.
"""

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Final

from dropanchor_service.estimation.fleet.belief.births.numbers import NAMES, without
from dropanchor_service.estimation.fleet.tuning import Tuning

_FLEET = "dropanchor_service.estimation.fleet"


class NoRuleError(ValueError):
    """No rule matches the pattern."""


@dataclass(frozen=True)
class Rule:
    """One rule. tuning: fields of `Tuning` with the values that take it out. constants: the same, as "module:NAME".
    births: of hypotheses, that are switched off.

    made_for: rows of `product` that it was made for.
    """

    name: str
    made_for: str
    tuning: Mapping[str, float] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    births: Sequence[str] = ()

    @property
    def numbers(self) -> list[str]:
        """The numbers that go with the rule."""
        return [*self.tuning, *(name.partition(":")[2] for name in self.constants)]

    def tuned(self) -> Tuning:
        """Return the tuning without the rule."""
        values = Tuning()._asdict() | {name: _KINDS[name](value) for name, value in self.tuning.items()}
        return Tuning(**(values | {"births": without(*self.births)}))

    def take_constants_out(self) -> None:
        """Change the constants of this process. Call it before anything is compiled: compiled code keeps its own."""
        for name, value in self.constants.items():
            module, _, constant = name.partition(":")
            setattr(importlib.import_module(f"{_FLEET}.{module}"), constant, value)


_KINDS: Final = Tuning.__annotations__

_NOT_ALONE: Final = {"given-start", "ring", "carried-start", "pick-up", "walked-off", "after-gap", "ring-again"}
"""Births without which a tag never starts, or starts for ever."""

RULES: Final = (
    *(Rule(f"birth: {name}", "reference/births.md says", births=(name,)) for name in NAMES if name not in _NOT_ALONE),
    Rule(
        "birth: any in the other direction",
        "forklift/*/*/*",
        births=("ahead-while-slow", "turned-after-stop", "pushed-back"),
    ),
    Rule(
        "birth: any without a line of sight",
        "S5+nlosburst/*",
        births=("sight-expected", "sight-lost", "sight-back"),
    ),
    Rule("outliers of ranges", "S5+nlos*/*", {"outlier_probability": 1e-9, "outlier_floor": 1e-12}),
    Rule("floor of the outliers", "*/scalar/everything/known", {"outlier_floor": 0.0}),
    Rule("tempered likelihood of ranges", "*/*/everything/known", {"likelihood_power": 1.0}),
    Rule("bias of ranges returns", "*/recorded/*/known", {"range_bias_tau": 1e9}),
    Rule("largest detour of a range", "*/*/nothing/unknown", {"nlos_max_bias": math.inf}),
    Rule(
        "a heading's error that wanders",
        "*/scalar/nothing/*",
        constants={"belief.heading_models:SWITCH_LOG_RATIO": math.inf},
    ),
    Rule("coarser merging at rest", "*/*/nothing/*", {"merge_distance_at_rest": Tuning().merge_distance}),
    Rule("hysteresis of modes", "*/*/*/unknown", {"mode_hysteresis": 0.0}),
    Rule("any mounting angle", "forklift/*/nothing/*", {"mount_any": 1e-12}),
    Rule("place walks", "rolling/scalar/*/*", {"q_position": 0.0}),
    Rule("speed walks", "rolling/scalar/*/*", {"q_speed": 0.0}),
    Rule("bias of a rough ride", "*/recorded/*/*", {"acc_bias_roughness": 0.0}),
    Rule("bending of a rough ride", "*/9-axis/*/*", {"bending_roughness": 0.0}),
    Rule("arcs widen the biases", "rolling/*/*/*", {"bending_s": 0.0}),
    Rule("wider sideways bias", "*/*/nothing/*", {"left_bias_std": Tuning().acc_bias_std}),
    Rule("fewer hypotheses after a gap", "*/*/*/*", {"coarse_hypotheses": 192, "coarse_split_angle": 0.08}),
    Rule("sideways axis", "*/*/nothing/*", constants={"measurement.lateral:SMOOTH": 0.0}),
    Rule(
        "sideways axis weighs mounting angles and finds rigid mounts",
        "*/*/nothing/*",
        constants={"measurement.lateral:POWER": 0.0, "belief.rigidity:POWER": 0.0},
    ),
    Rule("skids count less", "*/9-axis/*/*", constants={"measurement.lateral:BOUND": 1e3}),
    Rule(
        "shaking along one direction is motion",
        "OU/*/*/*",
        constants={"frontend.preintegration:ONE_WAY": 2.0, "measurement.lateral:ONE_WAY": 2.0},
    ),
    Rule("a rest that may be a smooth ride", "rolling/*/*/*", constants={"measurement.rest:SPEEDS": 1e9}),
    Rule("level rides tell the gyroscope's bias", "rolling/*/*/*", constants={"frontend.level_ride:SMOOTH": 0.0}),
    Rule("bound of the tilt's correction", "*/9-axis/*/*", constants={"frontend.attitude:BOUND": 1e3}),
    Rule("tilt teaches the gyroscope's bias", "*/9-axis/*/*", constants={"frontend.attitude:TAU_BIAS": 1e9}),
    Rule("rough rides tilt less", "*/9-axis/*/*", constants={"frontend.attitude:ROUGH_NOISE": 0.0}),
    Rule("size of gravity is learned", "*/9-axis/*/*", constants={"frontend.attitude:TAU_GRAVITY": 1e9}),
    Rule("tilt of a gyroscope that no rest has taught", "*/9-axis/*/*", constants={"belief.tilt:TILTING_S": 1e9}),
    Rule("standstill", "*/*/*/*", constants={"frontend.standstill:HOLD": math.inf}),
    Rule("magnetic disturbance", "*/9-axis/nothing/*", constants={"frontend.magnetometer:GATE": 1e9}),
    Rule("lasting error of north", "*/9-axis/nothing/*", constants={"frontend.magnetometer:SYSTEMATIC": 0.0}),
    Rule("direction of the steps", "walk-*/*/*/*", {"gait_angle_std": 1e3}),
    Rule(
        "steps that point backwards",
        "walk-*/*/*/*",
        constants={"measurement.steps:FLIPPED": 0.0},
    ),
    Rule("speed of the steps", "walk-*/*/*/*", {"step_speed_share": 0.0, "step_speed_std": 1e3}),
    Rule("tempered likelihood of walks", "walk-*/*/*/*", {"walk_likelihood_power": Tuning().likelihood_power}),
    Rule("spread of walks", "walk-*/*/*/*", {"walk_spread": 1.0}),
    Rule("devices held about as they point", "walk-hand/*/*/*", {"front_share": 0.0}),
    Rule("wider splits of walks", "walk-*/*/*/*", {"walk_split_angle": Tuning().split_angle}),
)


def selected(patterns: Sequence[str]) -> list[Rule]:
    """Return the rules that match a shell pattern, or all of them without patterns. Raises NoRuleError."""
    for pattern in patterns:
        if not any(fnmatchcase(rule.name, pattern) for rule in RULES):
            raise NoRuleError(f"no rule matches {pattern!r}; --list prints all rules")
    return [rule for rule in RULES if not patterns or any(fnmatchcase(rule.name, pattern) for pattern in patterns)]
