"""A firing test: the models of its file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PrivateAttr, model_validator

from warpimpact.firing.directions import Directions
from warpimpact.firing.estimators import Estimator
from warpimpact.firing.procedures import AnyProcedure
from warpimpact.firing.rules import FairHit, Gun
from warpimpact.scene.input_files import InputFile
from warpimpact.scene.model import Model
from warpimpact.scene.units import NonNegativeNumber, Number, PositiveSpeed, Title

Size = Annotated[int, Field(strict=True, ge=4, le=200)]
Share = Annotated[Number, Field(gt=0, lt=1)]


class FiringTarget(Model):
    """The target is exactly one of campaign, limits, sweep, mean and velocities.

    Attributes:
        campaign: campaign file, whose limit velocities are searched.
        limits: result of `warpimpact limit`.
        sweep: result of `warpimpact sweep` over impact.velocity, for targets whose limits are not unique.
        layer: layer that must hold, 0 is the plate; of a campaign the layers behind it are left out. Not given, it is
            the last one.
        count: limits that are searched of a campaign.
        tolerance: how far the two ends of a searched limit may lie apart [m/s]; the limit itself is nearer.
        mean, deviation: limit velocities with a normal distribution [m/s].
        velocities: known limit velocities [m/s].
        shares: of the hits that have each of them.
    """

    campaign: InputFile | None = None
    limits: InputFile | None = None
    sweep: InputFile | None = None
    layer: Annotated[int, Field(strict=True, ge=0)] | None = None
    count: Annotated[int, Field(strict=True, ge=1, le=2**20)] = 256
    tolerance: PositiveSpeed = 4.0
    mean: PositiveSpeed | None = None
    deviation: PositiveSpeed | None = None
    velocities: Annotated[tuple[PositiveSpeed, ...], Field(min_length=1, max_length=1000)] | None = None
    shares: tuple[NonNegativeNumber, ...] | None = None

    @model_validator(mode="after")
    def _is_one(self) -> FiringTarget:
        kinds = ("campaign", "limits", "sweep", "mean", "velocities")
        given = [name for name in kinds if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"got {' and '.join(given) or 'nothing'}, but it must be one of {', '.join(kinds)}")
        for name, needs in {"deviation": "mean", "shares": "velocities"}.items():
            if (getattr(self, name) is None) == (needs in given):
                raise ValueError(f"{needs} and {name} must be given together")
        velocities, shares = self.velocities or (), self.shares or ()
        if len(velocities) != len(shares) or (shares and not sum(shares) > 0.0):
            raise ValueError(
                f"got {len(velocities)} velocities and {len(shares)} shares, but there must be a share for each "
                "velocity, and their sum must be greater than 0"
            )
        if self.layer is not None and not ({"campaign", "sweep"} & {*given}):
            raise ValueError("layer needs campaign or sweep")
        return self


class Precision(Model):
    """Asks how many shots a precision needs.

    Attributes:
        within: largest difference of the reported V50 from the true one [m/s].
        share: of the tests that must be within that difference.
        sizes: numbers of shots that are tried.
    """

    within: PositiveSpeed
    share: Share = 0.9
    sizes: Annotated[tuple[Size, ...], Field(min_length=1, max_length=20)] = (6, 8, 10, 12, 16, 20, 30, 40, 60)


class Required(Model):
    """A required V50.

    Attributes:
        v50: least V50 that a test must report [m/s].
        by: what must reach it: the reported "v50", or the lower end of its interval ("lower_end").
    """

    v50: PositiveSpeed
    by: Literal["v50", "lower_end"] = "v50"


class Proof(Model):
    """Shots at one velocity, of which at most some may perforate.

    Attributes:
        velocity: velocity aimed at [m/s]; by default that of the named requirement.
        shots: shots of a test; by default the fewest that show `stop_probability` at `confidence`.
        allowed: perforations with which a target still passes.
        stop_probability: probability of a stop that a pass shall show.
        confidence: confidence at which it shows this.
    """

    velocity: PositiveSpeed | None = None
    shots: Annotated[int, Field(strict=True, ge=1, le=100_000)] | None = None
    allowed: Annotated[int, Field(strict=True, ge=0, le=1000)] = 0
    stop_probability: Share = 0.9
    confidence: Share = 0.9

    @model_validator(mode="after")
    def _can_fail(self) -> Proof:
        if self.shots is not None and self.allowed >= self.shots:
            raise ValueError(f"got allowed = {self.allowed}, but it must be less than shots = {self.shots}")
        return self


class FiringTest(Model):
    """A firing test: target, procedure, and questions.

    Attributes:
        title: one line, which the figure shows.
        tests: how often the procedure is fired.
        seed: of all random numbers.
        target: what is fired at.
        procedure: how V50 is sought.
        gun: how well a velocity is met.
        fair_hit: which hits count.
        estimator: what is reported.
        precision: asks how many shots a precision takes.
        required: asks how often a required V50 is reported.
        requirement: a named requirement, such as "STANAG 4569 L3", which gives core, velocity, proof and directions,
            unless the file does.
        threat: of a requirement that has several.
        proof: asks how often n shots with at most k perforations pass.
        directions: asks for P(perforation) over directions of fire; the target is then a campaign.
    """

    title: Title
    tests: Annotated[int, Field(strict=True, ge=1, le=100_000)] = 1000
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**63)] = 0
    target: FiringTarget
    procedure: AnyProcedure | None = None
    gun: Gun = Gun()
    fair_hit: FairHit = FairHit()
    estimator: Estimator = Estimator()
    precision: Precision | None = None
    required: Required | None = None
    requirement: Title | None = None
    threat: Title | None = None
    proof: Proof | None = None
    directions: Directions | None = None
    _source: str = PrivateAttr("")

    @property
    def text(self) -> str:
        """The TOML file as it was read; of a test made in Python, its values as JSON."""
        return self._source or self.model_dump_json()

    @property
    def needs_limits(self) -> bool:
        """Whether the test needs the response of its target."""
        return self.procedure is not None or self.proof is not None or self.directions is None

    @model_validator(mode="after")
    def _goes_together(self) -> FiringTest:
        for name in ("precision", "required"):
            if getattr(self, name) is not None and self.procedure is None:
                raise ValueError(f"{name} needs procedure")
        if self.estimator.name == "dixon_mood" and getattr(self.procedure, "name", None) != "up_and_down":
            raise ValueError('estimator.name = "dixon_mood" needs procedure.name = "up_and_down"')
        by_mean = self.estimator.name in ("mean", "dixon_mood") or (
            self.estimator.name is None and getattr(self.procedure, "name", None) == "mil_std_662f"
        )
        if self.required is not None and self.required.by == "lower_end" and by_mean:
            raise ValueError('required.by = "lower_end" needs an estimator with an interval: "probit" or "logit"')
        if self.directions is not None and self.target.campaign is None:
            raise ValueError("directions needs target.campaign")
        if self.threat is not None and self.requirement is None:
            raise ValueError("threat needs requirement")
        if self.proof is not None and self.proof.velocity is None and self.requirement is None:
            raise ValueError("proof.velocity: is missing, but must be given")
        return self
