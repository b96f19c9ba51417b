"""DrivelinePlant.fmu, stepped from Python; needs fmpy."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any


class Plant:
    """An instance of an FMU, initialized with its start values. Use it as a context manager: it keeps the unpacked FMU in a temporary folder."""

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
        """Current value of a variable."""
        reference = [self._reference(name)]
        values = self._fmu.getInteger(reference) if name in self._integers else self._fmu.getReal(reference)
        return float(values[0])

    def step(self, seconds: float, **inputs: float) -> None:
        """Advances by ``seconds``, with the inputs held."""
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
