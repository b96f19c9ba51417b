"""Where a clutch simulation departs from a car, which effect causes it, and how far the gap shrinks.

    import kisspoint
    kisspoint.gap("measurements/car_17")     # how far the simulation is off, per recording and channel
    found = kisspoint.diagnose("measurements/car_17", out="out/car_17")
    print(found.sentence)
    found.figure("r01")                      # car, before, after; needs matplotlib
    with found.load_plant(theta_c_start=120.0) as plant:
        plant.step(1e-3, x_to=6.0, T_e_ref=40.0)
"""

import json
import math
import tempfile
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _campaign
from ._command import KisspointError, run
from ._plant import Plant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Diagnosis", "Gaps", "KisspointError", "Plant", "__version__", "diagnose", "gap", "inspect", "load_plant"]

try:
    __version__ = metadata.version("kisspoint")
except metadata.PackageNotFoundError:  # a checkout on the path
    __version__ = "0+unknown"


def _numbers(values: list[float | None]) -> list[float]:
    return [math.nan if value is None else float(value) for value in values]


class Diagnosis(Mapping[str, Any]):
    """diagnosis.json as a mapping, with its most important parts as properties."""

    def __init__(self, campaign: Path, out: Path, keep: "list[tempfile.TemporaryDirectory[str]]") -> None:
        self.campaign = campaign
        """Folder of the recordings."""
        self.out = out
        """Folder of the answer."""
        self._keep = keep
        self._json: dict[str, Any] = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))

    def __getitem__(self, key: str) -> Any:
        return self._json[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._json)

    def __len__(self) -> int:
        return len(self._json)

    def __repr__(self) -> str:
        return f"<Diagnosis {self.verdict}: {self.sentence}>"

    @property
    def verdict(self) -> str:
        """One of no_gap, explained, partly_explained, unexplained, inputs_do_not_fit."""
        return str(self["verdict"])

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        return str(self["sentence"])

    @property
    def confidence(self) -> float:
        """Probability that the verdict holds, 0 to 1: that nothing is wrong, that exactly the named effects are there, or that the gap lies where the verdict says."""
        return float(self["confidence"])

    @property
    def effects(self) -> list[str]:
        """Ids of the effects that were added to the model, most important first."""
        return [effect["id"] for effect in self["which"]["effects"]]

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """Parameters of these effects as rows: effect, parameter, value, low and high of the 95 % interval, unit."""
        return [
            {"effect": effect["id"], "parameter": name, **{key: found[key] for key in ("value", "low", "high", "unit")}}
            for effect in self["which"]["effects"]
            for name, found in effect["parameters"].items()
        ]

    @property
    def report(self) -> Path:
        """The report, one page for a browser."""
        return self.out / "report.html"

    @property
    def fmu(self) -> Path:
        """Path of the retuned plant's FMU."""
        return self.out / "DrivelinePlant.fmu"

    def load_plant(self, **start: float) -> Plant:
        """Loads the retuned plant for stepping."""
        return Plant(self.fmu, **start)

    @property
    def recordings(self) -> list[str]:
        """Names of the curves: one per recording, or one per engagement of a drive."""
        return list(self._curves())

    def _curves(self) -> dict[str, Any]:
        found = json.loads((self.out / "curves.json").read_text(encoding="utf-8"))["recordings"]
        return {curves["recording"]: curves for curves in found}

    def replay(self, recording: str) -> dict[str, dict[str, list[float]]]:
        """The report's curves of a recording: ``real``, ``before`` and ``after`` by channel, with ``real["time_s"]``; NaN where the car has no value.

        The models are replayed freely from the first sample.
        """
        curves = self._curves()
        if recording not in curves:
            raise KeyError(f"there are no curves of {recording!r}; there are {', '.join(curves)}")
        channels, dt = curves[recording]["channels"], curves[recording]["dt_s"]
        samples = max(len(channel["real"]) for channel in channels.values())
        runs = {run: {name: _numbers(channel[run]) for name, channel in channels.items()} for run in ("real", "before", "after")}
        runs["real"]["time_s"] = [k * dt for k in range(samples)]
        return runs

    def figure(self, recording: str) -> "Figure":
        """A figure of both speeds of a recording: car, before and after. The recording may have any file format that the command reads."""
        from matplotlib.figure import Figure

        runs = self.replay(recording)
        # The car's curve is wide, so that it remains visible behind a model's curve that fits.
        styles: dict[str, dict[str, Any]] = {"real": {"color": "0.7", "lw": 4}, "before": {"color": "C1", "ls": "--"}, "after": {"color": "C0"}}
        figure = Figure(figsize=(8, 5), layout="constrained")
        for axes, channel in zip(figure.subplots(2, 1, sharex=True), ("omega_f_rad_s", "omega_c_rad_s"), strict=True):
            for name, style in styles.items():
                axes.plot(runs["real"]["time_s"], runs[name][channel], **style, label="car" if name == "real" else name)
            axes.set_ylabel(channel.replace("_rad_s", "") + " [rad/s]")
        figure.axes[0].legend()
        figure.axes[1].set_xlabel("time [s]")
        figure.suptitle(f"{recording}: {', '.join(self.effects) or self.verdict.replace('_', ' ')}")
        return figure


def diagnose(
    campaign: str | Path | Mapping[str, Any],
    *,
    about: Mapping[str, Mapping[str, Any]] | None = None,
    vehicle: str | Path | Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    channel_map: str | Path | None = None,
    strict: bool = False,
    threads: int = 0,
) -> Diagnosis:
    """Diagnoses a campaign: a folder, or a mapping from recording names to DataFrames.

    With DataFrames, ``about`` holds what recordings.json holds for each, and ``vehicle`` is a vehicle file or its content.
    ``out`` is the folder for the answer; without it, the answer is deleted along with the returned object.
    ``channel_map`` is a TOML or JSON file that gives the names and units of the channels. With ``strict``, a recording with a defect is an error;
    otherwise it is left out. ``threads`` limits the threads (0: all cores); the answer does not depend on it.
    """
    keep: list[tempfile.TemporaryDirectory[str]] = []
    if not isinstance(campaign, Mapping) and (about is not None or vehicle is not None):
        raise ValueError("about and vehicle belong to recordings in memory; a folder has recordings.json and vehicle.json")
    source = _source(campaign, about, vehicle, keep)
    target = Path(out) if out is not None else _folder(keep)
    options = ["--strict"] if strict else []
    run("diagnose", source, "--out", target, "--curves", "--threads", threads, *options, *_mapped(channel_map))
    return Diagnosis(source, target, keep)


def _folder(keep: "list[tempfile.TemporaryDirectory[str]]") -> Path:
    keep.append(tempfile.TemporaryDirectory(prefix="kisspoint-"))
    return Path(keep[-1].name)


def _source(
    campaign: str | Path | Mapping[str, Any],
    about: Mapping[str, Mapping[str, Any]] | None,
    vehicle: str | Path | Mapping[str, Any] | None,
    keep: "list[tempfile.TemporaryDirectory[str]]",
) -> Path:
    """The folder of a campaign; for recordings in memory, a folder is written first."""
    if not isinstance(campaign, Mapping):
        return Path(campaign)
    if about is None or vehicle is None:
        raise ValueError("recordings in memory need about (manoeuvre, sample_rate_Hz, theta_c0_degC, theta_b0_degC of each) and vehicle")
    folder = _folder(keep)
    _campaign.write(folder, campaign, about, vehicle)
    return folder


class Gaps(list[dict[str, Any]]):
    """A list of dicts with recording, manoeuvre, channel, unit, rms and noise. ``notes`` holds the reader's remarks, ``left_out`` the recordings that it left out."""

    notes: list[dict[str, str]]
    left_out: list[dict[str, str]]


def gap(
    campaign: str | Path | Mapping[str, Any],
    *,
    about: Mapping[str, Mapping[str, Any]] | None = None,
    vehicle: str | Path | Mapping[str, Any] | None = None,
    channel_map: str | Path | None = None,
) -> Gaps:
    """Gap between the simulation and the recordings of a campaign, before any diagnosis. Campaign, ``about`` and ``channel_map`` are as for `diagnose`.

    With a folder, ``vehicle`` (a file or its content) replaces the folder's own vehicle.json.
    """
    keep: list[tempfile.TemporaryDirectory[str]] = []
    options: list[str] = []
    if not isinstance(campaign, Mapping):
        if about is not None:
            raise ValueError("about belongs to recordings in memory; a folder has recordings.json")
        if isinstance(vehicle, Mapping):
            document = _folder(keep) / "vehicle.json"
            document.write_text(json.dumps(dict(vehicle)), encoding="utf-8")
            vehicle = document
        options = ["--vehicle", str(vehicle)] if vehicle is not None else []
    source = _source(campaign, about, vehicle, keep)
    found = json.loads(run("replay", source, "--json", *options, *_mapped(channel_map)))
    gaps = Gaps(found["gaps"])
    gaps.notes, gaps.left_out = found["notes"], found["left_out"]
    return gaps


def inspect(file: str | Path) -> dict[str, Any]:
    """Content of a measurement file (CSV, MDF4, Parquet): ``channels`` with unit, rate, range and a guess of the quantity, and ``notes``."""
    found: dict[str, Any] = json.loads(run("inspect", file, "--json"))
    return found


def _mapped(channel_map: str | Path | None) -> list[str]:
    return ["--channel-map", str(channel_map)] if channel_map is not None else []


def load_plant(fmu: str | Path, **start: float) -> Plant:
    """Loads a plant, nominal or retuned, for stepping. ``start`` holds start values by their full names (``**{"friction.mu_0": 0.2}``)."""
    return Plant(fmu, **start)
