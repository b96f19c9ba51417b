"""The A2L file of each FMU, read by an independent parser, and the values at its addresses."""

import ctypes
import zipfile

import pytest
from lxml import etree
from pya2l.parser import A2lParser


def tree(fmu):
    archive = zipfile.ZipFile(fmu)
    name = next(n for n in archive.namelist() if n.endswith("linux64/" + fmu.stem + ".a2l"))
    with A2lParser() as parser:
        return parser.tree_from_a2l(archive.read(name)).PROJECT.MODULE[0]


@pytest.mark.parametrize("name", ["plant", "controller"])
def test_every_variable_stands_at_its_address(request, fmus, name):
    model = request.getfixturevalue(name)
    module = tree(model.path)
    address = {m.Name.Value: m.ECU_ADDRESS.Address.Value for m in module.MEASUREMENT}
    address |= {c.Name.Value: c.Address.Value for c in module.CHARACTERISTIC}
    assert set(address) == set(model.variables)
    instance = model.instance()
    base, count = ctypes.POINTER(ctypes.c_double)(), ctypes.c_size_t()
    share = instance.fmu.dll.kisspoint_values
    share.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    assert share(instance.fmu.component, ctypes.byref(base), ctypes.byref(count)) == 0 and count.value == len(address)
    instance.step(0.01)
    for variable, place in address.items():
        assert base[place // 8] == float(instance.get(variable)), variable
    # A value written there is used by the next step; one that may not be changed is refused by the next step and restored.
    tunable = "effect.friction_level.factor" if name == "plant" else "controller.kp_engine"
    base[address[tunable] // 8] = 0.75
    instance.step(0.01)
    assert instance.get(tunable) == 0.75
    for variable, value in ((tunable, 1e6), ("driveline.J_c", 0.6)):
        before = instance.get(variable)
        base[address[variable] // 8] = value
        with pytest.raises(Exception):
            instance.step(0.01)
        assert instance.get(variable) == before
        instance.step(0.01)
    instance.free()


@pytest.mark.parametrize("model", ["DrivelinePlant", "ClutchController"])
def test_the_manifest_names_the_file(fmus, model):
    archive = zipfile.ZipFile(fmus[model])
    manifest = etree.fromstring(archive.read("extra/org.fmi-standard.fmi-ls-xcp/fmi-ls-manifest.xml"))
    space = "{http://fmi-standard.org/fmi-ls-manifest}"
    assert (manifest.get(space + "fmi-ls-name"), manifest.get(space + "fmi-ls-version")) == ("org.fmi-standard.fmi-ls-xcp", "1.0.0")
    interface = manifest.find("Interface")
    assert interface.get("supportsDirectMemoryAccess") == "true" and interface.get("definition") == model + ".a2l"
