"""Microseconds per step of DrivelinePlant.fmu beside a pythonfmu FMU of the same scheme, through FMPy and from C.

    python benches/pythonfmu.py out/DrivelinePlant.fmu       needs fmpy, pythonfmu and a C compiler

Both run the launch of benches/step.rs, inputs set in each step, in alternation. Their final states are compared, so that neither leaves
work out. Medians of LAUNCHES launches.
"""

import ctypes
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

HERE = Path(__file__).parent
STEP, STEPS, LAUNCHES = 1e-3, 2000, 15
INPUTS = [(4.5 + 1.2 * min(k * STEP, 1.0) if k * STEP < 1.6 else 8.2, 30.0 if k * STEP < 1.9 else 60.0) for k in range(STEPS)]
OUTPUTS = ("omega_f", "theta_c", "E_d")


class Plant:
    def __init__(self, path):
        self.description = read_model_description(str(path))
        self.folder = extract(str(path))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}

    def launch(self, steps):
        """Microseconds per step of one launch, made by `steps`, and the state at its end."""
        fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="plant",
        )
        fmu.instantiate()
        if "omega_f_start" in self.references:
            fmu.setReal([self.references["omega_f_start"]], [104.71975511965978])
        commands = [self.references["x_to"], self.references["T_e_ref"]]
        fmu.setReal(commands, INPUTS[0])
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        took = steps(fmu, commands)
        end = fmu.getReal([self.references[name] for name in OUTPUTS])
        fmu.terminate()
        fmu.freeInstance()
        return 1e6 * took / STEPS, end


def through_fmpy(fmu, commands):
    begin = perf_counter()
    for k, values in enumerate(INPUTS):
        fmu.setReal(commands, values)
        fmu.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
    return perf_counter() - begin


def compiled(folder):
    """The same loop in C."""
    library = folder / "steps.so"
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", str(library), str(HERE / "peer" / "steps.c")], check=True)
    steps = ctypes.CDLL(str(library)).steps
    steps.restype = ctypes.c_double
    flat = (ctypes.c_double * (2 * STEPS))(*(x for pair in INPUTS for x in pair))

    def from_c(fmu, commands):
        references = (ctypes.c_uint * 2)(*commands)
        set_real, do_step = (ctypes.cast(f, ctypes.c_void_p) for f in (fmu.dll.fmi2SetReal, fmu.dll.fmi2DoStep))
        component = ctypes.c_void_p(fmu.component)
        return steps(component, set_real, do_step, references, flat, ctypes.c_long(STEPS), ctypes.c_double(STEP))

    return from_c


def built(folder):
    """The peer's FMU, made by pythonfmu."""
    script = HERE / "peer" / "plant_pythonfmu.py"
    words = [sys.executable, "-m", "pythonfmu", "build", "-f", str(script), "-d", str(folder)]
    subprocess.run(words, check=True, capture_output=True, text=True)
    return folder / "PeerPlant.fmu"


def compare(name, plants, steps):
    took = {who: [] for who in plants}
    for _ in range(LAUNCHES):
        ends = {}
        for who, plant in plants.items():
            microseconds, ends[who] = plant.launch(steps)
            took[who].append(microseconds)
        for output, a, b in zip(OUTPUTS, ends["kisspoint"], ends["pythonfmu"]):
            if abs(a - b) > 1e-6 * max(1.0, abs(b)):
                sys.exit(f"{output} ends at {a}, and at {b} by the peer")
    ours, peer = (statistics.median(took[who]) for who in ("kisspoint", "pythonfmu"))
    print(f"plant {name}: {ours:.2f} us per step, pythonfmu {peer:.1f} us: {peer / ours:.0f} times")


def main(ours):
    with tempfile.TemporaryDirectory() as folder:
        plants = {"kisspoint": Plant(ours), "pythonfmu": Plant(built(Path(folder)))}
        compare("through FMPy", plants, through_fmpy)
        compare("from C", plants, compiled(Path(folder)))


if __name__ == "__main__":
    main(sys.argv[1]) if len(sys.argv) == 2 else sys.exit(__doc__)
