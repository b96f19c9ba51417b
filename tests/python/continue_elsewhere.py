"""Continues a run from a serialized state: FMU STATE TIME FIRST LAST OUT."""

import sys
from pathlib import Path

from master import Model
from test_states import drive

if __name__ == "__main__":
    fmu, state, time, first, last, out = sys.argv[1:]
    instance = Model(fmu).instance()
    saved = instance.fmu.deSerializeFMUstate(Path(state).read_bytes())
    instance.restore(saved, float(time))
    drive(instance, int(first), int(last))
    Path(out).write_bytes(instance.bytes())
    instance.free()
