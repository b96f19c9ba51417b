"""Where a clutch simulation departs from a car, which effect causes it, and how far the gap shrinks.

    import kisspoint
    found = kisspoint.diagnose("measurements/car_17", out="out/car_17")
    print(found.sentence)
    found.figure("r01")                      # real, before, after; needs fmpy and matplotlib
    with found.load_plant(theta_c_start=120.0) as plant:
        plant.step(1e-3, x_to=6.0, T_e_ref=40.0)
"""

import json
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _campaign
from ._command import KisspointError, run
from ._plant import Plant, replay

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Diagnosis", "KisspointError", "Plant", "diagnose", "load_plant"]


class Diagnosis(Mapping[str, Any]):
    """diagnosis.json as a mapping, with its most wanted parts by name."""

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
        """no_gap, explained, partly_explained or unexplained."""
        return str(self["verdict"])

    @property
    def sentence(self) -> str:
        """The verdict in a sentence."""
        return str(self["sentence"])

    @property
    def confidence(self) -> float:
        """Of the verdict, 0 to 1."""
        return float(self["confidence"])

    @property
    def effects(self) -> list[str]:
        """The effects added, most important first."""
        return [effect["id"] for effect in self["which"]["effects"]]

    @property
    def report(self) -> Path:
        """The report, one page for a browser."""
        return self.out / "report.html"

    @property
    def fmu(self) -> Path:
        """The retuned plant."""
        return self.out / "DrivelinePlant.fmu"

    def load_plant(self, **start: float) -> Plant:
        """The retuned plant, to be stepped."""
        return Plant(self.fmu, **start)

    def replay(self, recording: str) -> dict[str, dict[str, list[float]]]:
        """Speeds of a CSV recording with the contract's column names: ``real``, ``before`` and ``after``, with ``time_s``."""
        table = _campaign.read_csv(self.campaign / f"{recording}.csv")
        about = json.loads((self.campaign / "recordings.json").read_text(encoding="utf-8"))[recording]
        warm = {"theta_c_start": about["theta_c0_degC"], "theta_b_start": about["theta_b0_degC"]}
        real = {name: table[name] for name in ("time_s", "omega_f_rad_s", "omega_c_rad_s")}
        plant = self["plant"]
        return {
            "real": real,
            "before": replay(self.fmu, table, {**warm, **plant["nominal_parameters"]}),
            "after": replay(self.fmu, table, {**warm, **plant["parameters"]}),
        }

    def figure(self, recording: str) -> "Figure":
        """Both speeds of a recording: real, before and after."""
        from matplotlib.figure import Figure

        runs = self.replay(recording)
        # The car's curve is wide, so that it stays visible behind one that fits.
        styles = {"real": {"color": "0.7", "lw": 4}, "before": {"color": "C1", "ls": "--"}, "after": {"color": "C0"}}
        figure = Figure(figsize=(8, 5), layout="constrained")
        for axes, channel in zip(figure.subplots(2, 1, sharex=True), ("omega_f_rad_s", "omega_c_rad_s"), strict=True):
            for name, style in styles.items():
                axes.plot(runs["real"]["time_s"], runs[name][channel], **style, label=name)
            axes.set_ylabel(channel.replace("_rad_s", "") + " [rad/s]")
        figure.axes[0].legend()
        figure.axes[1].set_xlabel("time [s]")
        figure.suptitle(f"{recording}: {', '.join(self.effects) or self.verdict}")
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
    """Diagnoses a campaign: a folder, or a DataFrame per recording.

    With DataFrames, ``about`` holds what recordings.json holds for each, and ``vehicle`` is a vehicle file or its content.
    Without ``out`` the answer lives as long as the returned object.
    """
    keep: list[tempfile.TemporaryDirectory[str]] = []

    def folder() -> Path:
        keep.append(tempfile.TemporaryDirectory(prefix="kisspoint-"))
        return Path(keep[-1].name)

    if isinstance(campaign, Mapping):
        if about is None or vehicle is None:
            raise ValueError("recordings in memory need about (manoeuvre, sample_rate_Hz, theta_c0_degC, theta_b0_degC of each) and vehicle")
        source = folder()
        _campaign.write(source, campaign, about, vehicle)
    else:
        if about is not None or vehicle is not None:
            raise ValueError("about and vehicle belong to recordings in memory; a folder has recordings.json and vehicle.json")
        source = Path(campaign)
    target = Path(out) if out is not None else folder()
    options = ["--strict"] if strict else []
    options += ["--channel-map", str(channel_map)] if channel_map is not None else []
    run("diagnose", source, "--out", target, "--threads", threads, *options)
    return Diagnosis(source, target, keep)


def load_plant(fmu: str | Path, **start: float) -> Plant:
    """A plant, nominal or retuned, to be stepped; ``start`` are start values by name, dots and all (``**{"friction.mu_0": 0.2}``)."""
    return Plant(fmu, **start)
