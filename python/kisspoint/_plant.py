"""DrivelinePlant.fmu, stepped from Python; needs fmpy."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any


class Plant:
    """One instance of an FMU, from its start values on; a context manager, for the FMU holds a folder of its own."""

    def __init__(self, fmu: str | Path, **start: float) -> None:
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave

        description = read_model_description(str(fmu))
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        self._integers = {v.name for v in description.modelVariables if v.type in ("Enumeration", "Integer")}
        self._folder = extract(str(fmu))
        self._fmu = FMU2Slave(
            guid=description.guid, unzipDirectory=self._folder, modelIdentifier=description.coSimulation.modelIdentifier, instanceName="plant"
        )
        self.time = 0.0
        self._fmu.instantiate()
        self._fmu.setupExperiment(startTime=0.0)
        self.set(start)
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()

    def set(self, values: Mapping[str, float]) -> None:
        """Sets variables by name, e.g. ``{"effect.friction_fade.depth": 0.2}``."""
        if values:
            self._fmu.setReal([self._reference(name) for name in values], [float(v) for v in values.values()])

    def get(self, name: str) -> float:
        """Value of a variable now."""
        reference = [self._reference(name)]
        values = self._fmu.getInteger(reference) if name in self._integers else self._fmu.getReal(reference)
        return float(values[0])

    def step(self, seconds: float, **inputs: float) -> None:
        """Goes on with the inputs held."""
        self.set(inputs)
        self._fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=seconds)
        self.time += seconds

    def _reference(self, name: str) -> int:
        if name not in self._references:
            raise KeyError(f"the plant has no variable {name!r}")
        return int(self._references[name])

    def close(self) -> None:
        """Frees the instance and its folder."""
        if self._folder:
            self._fmu.terminate()
            self._fmu.freeInstance()
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = ""

    def __enter__(self) -> "Plant":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


LOCKED_SLIP_RAD_S = 0.6
"""Slip below which a recording that starts with a closed clutch counts as starting locked, as docs/diagnosis.md says."""


def first_speeds(table: Mapping[str, Any], car: Mapping[str, float]) -> dict[str, float]:
    """Speeds to start from: those sensed first, without the sensor's gain; nearly equal ones of a closed clutch start as their mean."""
    sensed = {name: float(next(iter(table[name]))) for name in ("omega_f_rad_s", "omega_c_rad_s", "x_to_cmd_mm")}
    omega_f, omega_c = sensed["omega_f_rad_s"], sensed["omega_c_rad_s"] / car["effect.clutch_speed_gain.gain"]
    closed = sensed["x_to_cmd_mm"] > 0.5 * (car["actuator.x_cnt_0"] + car["actuator.x_cls_0"])
    if closed and abs(omega_f - omega_c) < LOCKED_SLIP_RAD_S:
        omega_f = omega_c = 0.5 * (omega_f + omega_c)
    return {"omega_f_start": omega_f, "omega_c_start": omega_c}


def replay(fmu: str | Path, table: Mapping[str, Any], car: Mapping[str, float], warm: Mapping[str, float]) -> dict[str, list[float]]:
    """Both speeds as the plant has them when it is driven by a recording's inputs, each held to the next sample.

    ``car`` holds the parameters of the plant, ``warm`` its start temperatures.
    """
    time = [float(t) for t in table["time_s"]]
    speeds: dict[str, list[float]] = {"omega_f_rad_s": [], "omega_c_rad_s": []}
    inputs = zip(table["x_to_cmd_mm"], table["T_e_Nm"], table["theta_h_degC"], strict=True)
    drive = [{"x_to": float(x), "T_e_ref": float(t), "theta_h": float(h)} for x, t, h in inputs]
    with Plant(fmu, **first_speeds(table, car), **drive[0], **warm, **car) as plant:
        for k, held in enumerate(drive):
            speeds["omega_f_rad_s"].append(plant.get("omega_f"))
            speeds["omega_c_rad_s"].append(plant.get("omega_c"))
            if k + 1 < len(time):
                plant.step(time[k + 1] - time[k], **held)
    return speeds
