"""A small co-simulation master on FMPy, with access to variables by name, and with Jacobi and Gauss–Seidel coupling."""

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave, fmi2Integer, fmi2Real, fmi2ValueReference


PLANT_TO_CONTROLLER = {"omega_f": "omega_f", "omega_c": "omega_c", "T_e": "T_e"}
CONTROLLER_TO_PLANT = {"x_to": "x_to", "T_e_ref": "T_e_ref", "T_brake": "T_brake"}


class Model:
    """An unpacked FMU, from which instances are made."""

    def __init__(self, path):
        self.path = path
        self.description = read_model_description(str(path))
        self.folder = extract(str(path))
        self.variables = {v.name: v for v in self.description.modelVariables}

    def instance(self, **parameters):
        """An initialized instance."""
        made = self.fresh(**parameters)
        made.initialize()
        return made

    def fresh(self, **parameters):
        """An instance before initialization."""
        made = Instance(self)
        made.set(**parameters)
        return made


class Instance:
    """An instance whose variables are accessed by name; in keywords, dots are written as two underscores."""

    def __init__(self, model):
        self.model = model
        self.fmu = FMU2Slave(
            guid=model.description.guid,
            unzipDirectory=model.folder,
            modelIdentifier=model.description.coSimulation.modelIdentifier,
            instanceName="instance",
        )
        self.fmu.instantiate()
        self.time = 0.0

    def initialize(self, start=0.0):
        self.time = start
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def set(self, **values):
        for name, value in values.items():
            variable = self.model.variables[name.replace("__", ".")]
            setter = self.fmu.setBoolean if variable.type == "Boolean" else self.fmu.setReal
            setter([variable.valueReference], [value])

    def get(self, *names):
        values = []
        for name in names:
            variable = self.model.variables[name]
            getter = {"Real": self.fmu.getReal, "Boolean": self.fmu.getBoolean}.get(variable.type, self.fmu.getInteger)
            values.append(getter([variable.valueReference])[0])
        return values if len(values) > 1 else values[0]

    def outputs(self):
        names = [v.name for v in self.model.description.modelVariables if v.causality == "output"]
        return dict(zip(names, self.get(*names)))

    def set_slopes(self, **slopes):
        """Sets the first derivatives of inputs for the next step."""
        n = len(slopes)
        references = (fmi2ValueReference * n)(*(self.model.variables[name].valueReference for name in slopes))
        orders, values = (fmi2Integer * n)(*[1] * n), (fmi2Real * n)(*slopes.values())
        self.fmu.fmi2SetRealInputDerivatives(self.fmu.component, references, n, orders, values)

    def step(self, h):
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=h)
        self.time += h

    def save(self):
        return self.fmu.getFMUState()

    def restore(self, state, time):
        self.fmu.setFMUState(state)
        self.time = time

    def bytes(self):
        state = self.save()
        serialized = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return bytes(serialized)

    def free(self):
        self.fmu.freeInstance()


def connect(source, target, names):
    target.set(**dict(zip(names.values(), source.get(*names))))


def interpolate(plant, controller, h, passes):
    """One step of an interpolating master: it repeats the step from saved states, each time with inputs that move on straight lines to the end values found last."""
    wires = [(plant, controller, PLANT_TO_CONTROLLER), (controller, plant, CONTROLLER_TO_PLANT)]
    begins, ends = [source.get(*names) for source, _, names in wires], None
    saved = [(model, model.save(), model.time) for model in (plant, controller)]
    for k in range(passes):
        for model, state, time in saved if k else []:
            model.restore(state, time)
        for wire, (_, target, names) in enumerate(wires):
            target.set(**dict(zip(names.values(), begins[wire])))
            if ends:
                slopes = ((end - begin) / h for begin, end in zip(begins[wire], ends[wire]))
                target.set_slopes(**dict(zip(names.values(), slopes)))
        plant.step(h), controller.step(h)
        ends = [source.get(*names) for source, _, names in wires]
    for model, state, _ in saved:
        model.fmu.freeFMUState(state)


def couple(plant, controller, steps, scheme="gauss-seidel", on_step=None):
    """Advances both models over the given step lengths, the plant first."""
    connect(controller, plant, CONTROLLER_TO_PLANT)
    connect(plant, controller, PLANT_TO_CONTROLLER)
    for h in steps:
        if scheme == "interpolating":
            interpolate(plant, controller, h, passes=4)
        elif scheme == "jacobi":
            connect(controller, plant, CONTROLLER_TO_PLANT)
            connect(plant, controller, PLANT_TO_CONTROLLER)
            plant.step(h)
            controller.step(h)
        else:
            connect(controller, plant, CONTROLLER_TO_PLANT)
            plant.step(h)
            connect(plant, controller, PLANT_TO_CONTROLLER)
            controller.step(h)
        if on_step is not None and on_step():
            return
