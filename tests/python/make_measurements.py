"""Makes the measurement files of tests/data/campaign/measurements with asammdf, python-can and pyarrow.

    python -m venv venv && venv/bin/pip install asammdf==8.8.28 pyarrow==26.0.1 python-can==4.6.1
    venv/bin/python tests/python/make_measurements.py

The Rust tests read the committed files, so that they need neither Python nor a network. The expected content of the files is
the seed recording, tests/data/campaign/seed/r01.csv, which this script makes, too: a synthetic launch of 1.5 s at 100 Hz.
expected.json holds what asammdf and pyarrow read from the files, as sums per channel.
"""

import csv
import decimal
import json
import math
import struct
from pathlib import Path

import can
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from asammdf import MDF, Signal

DATA = Path(__file__).resolve().parent.parent / "data" / "campaign"
OUT = DATA / "measurements"
UNITS = {"omega_f_rad_s": "rad/s", "omega_c_rad_s": "rad/s", "T_e_Nm": "Nm", "x_to_cmd_mm": "mm", "theta_h_degC": "°C",
         "x_to_mm": "mm", "T_fc_Nm": "Nm", "theta_c_degC": "degC"}  # fmt: skip


def seed():
    """Columns of the seed recording, rounded as by a logger."""
    rng = np.random.default_rng(20261)
    t = np.arange(151) / 100
    rise = 1 / (1 + np.exp(-(t - 0.7) * 8))
    x = 3.0 + 2.2 * np.minimum(t / 1.2, 1)
    return {
        "time_s": np.round(t, 4),
        "omega_f_rad_s": np.round(105 + 60 * t - 45 * rise + rng.normal(0, 0.3, t.size), 3),
        "omega_c_rad_s": np.round((105 + 60 * t - 45 * rise) * rise + rng.normal(0, 0.3, t.size), 3),
        "T_e_Nm": np.round(90 * np.minimum(t / 0.4, 1) + rng.normal(0, 0.2, t.size), 1),
        "x_to_cmd_mm": np.round(x, 3),
        "theta_h_degC": np.full(t.size, 25.0),
        "x_to_mm": np.round(x + rng.normal(0, 0.01, t.size), 3),
        "T_fc_Nm": np.round(80 * rise + rng.normal(0, 0.5, t.size), 2),
        "theta_c_degC": np.round(36 + 20 * rise + rng.normal(0, 0.3, t.size), 1),
    }


def write_seed(columns):
    (DATA / "seed").mkdir(parents=True, exist_ok=True)
    with open(DATA / "seed" / "r01.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(c.tolist() for c in columns.values())))


def contract_signals(columns):
    t = columns["time_s"]
    return [Signal(columns[n].copy(), t, name=n, unit=u) for n, u in UNITS.items()]


def save(name, version="4.10", compression=0, groups=(), fragment=None):
    mdf = MDF(version=version)
    if fragment:
        mdf.configure(write_fragment_size=fragment)
    for signals, comment in groups:
        mdf.append(signals, comment=comment, acq_name=comment, common_timebase=True) if comment else mdf.append(
            signals, common_timebase=True
        )
    path = OUT / f"{name}.mf4"
    mdf.save(path, overwrite=True, compression=compression)
    mdf.close()
    return path


def rates(columns):
    """Names and units of a logger, and three rates: inputs at 50 Hz, speeds as scaled integers at 100 Hz, air temperature at 10 Hz."""
    t = columns["time_s"]
    rpm = 30 / math.pi
    to_rpm = {"a": 0.25, "b": 0.0}

    def scaled(name, column):
        raw = np.round(columns[column] * rpm / 0.25).astype("<i2")
        return Signal(raw, t, name=name, unit="rpm", conversion=to_rpm)

    def every(n, name, values, unit):
        return Signal(values[::n].copy(), t[::n].copy(), name=name, unit=unit)

    return [
        ([scaled("nEngine", "omega_f_rad_s"), scaled("nGbxInput", "omega_c_rad_s")], "CAN 10ms"),
        ([every(2, "TqEng", columns["T_e_Nm"], "Nm"), every(2, "BearingPosSet", columns["x_to_cmd_mm"] / 1000, "m")], "CAN 20ms"),
        ([every(10, "TempBellHousing", columns["theta_h_degC"] + 273.15, "K")], "CAN 100ms"),
    ]  # fmt: skip


def invalid(columns):
    """Three invalid samples in the disc speed and a long gap in the torque transducer."""
    signals = contract_signals(columns)
    for signal in signals:
        bad = np.zeros(signal.samples.size, dtype=bool)
        if signal.name == "omega_c_rad_s":
            bad[40:43] = True
        if signal.name == "T_fc_Nm":
            bad[60:90] = True
        signal.invalidation_bits = bad
        signal.samples = np.where(bad, -999.0, signal.samples)
    return signals


def tables(columns):
    """Parquet files: plain, compressed with nulls, and a logger's own layout with time stamps, and units in the metadata."""
    table = pa.table({n: pa.array(c) for n, c in columns.items()})
    pq.write_table(table, OUT / "plain.parquet", compression="snappy")
    gaps = dict(columns)
    holes = pa.array(columns["omega_c_rad_s"], mask=np.isin(np.arange(151), [40, 41, 42]))
    small = {n: pa.array(c.astype("float32")) for n, c in gaps.items() if n not in ("time_s", "omega_c_rad_s")}
    packed = pa.table({"time_s": pa.array(columns["time_s"]), "omega_c_rad_s": holes, **small})
    pq.write_table(packed, OUT / "zstd.parquet", compression="zstd", row_group_size=64)
    stamp = 1_790_000_000_000_000_000 + np.round(columns["time_s"] * 1e9).astype("int64")
    logger = pa.table({
        "time": pa.array(stamp, type=pa.timestamp("ns")),
        "nEngine": pa.array(columns["omega_f_rad_s"] * 30 / math.pi),
        "nGbxInput [rpm]": pa.array(columns["omega_c_rad_s"] * 30 / math.pi),
        "TqEng": pa.array(columns["T_e_Nm"]),
        "BearingPosSet": pa.array(np.round(columns["x_to_cmd_mm"] * 1000).astype("int32")),
        "TempBellHousing": pa.array(columns["theta_h_degC"] * 1.8 + 32),
        "gear": pa.array(["D"] * 151),
    })  # fmt: skip
    units = {"nEngine": "rpm", "TqEng": "Nm", "BearingPosSet": "um", "TempBellHousing": "°F"}
    logger = logger.replace_schema_metadata({"units": json.dumps(units)})
    pq.write_table(logger, OUT / "logger.parquet", compression="gzip")


def more_of_parquet(columns):
    """Column types other than plain numbers: flags, decimals, half precision, time stamps of 96 bits; brotli and lz4."""
    n = columns["time_s"].size
    time = pa.array(1_790_000_000_000_000_000 + np.round(columns["time_s"] * 1e9).astype("int64"), type=pa.timestamp("ns"))
    decimals = [decimal.Decimal(f"{v:.3f}") for v in columns["omega_c_rad_s"]]
    table = pa.table({
        "time": time,
        "omega_f_rad_s": pa.array(columns["omega_f_rad_s"]),
        "omega_c_rad_s": pa.array(decimals, type=pa.decimal128(12, 3)),
        "T_e_Nm": pa.array(columns["T_e_Nm"].astype("float16")),
        "x_to_cmd_mm": pa.array([decimal.Decimal(f"{v:.3f}") for v in columns["x_to_cmd_mm"]], type=pa.decimal128(7, 3)),
        "brake": pa.array(np.arange(n) >= 140),
    })  # fmt: skip
    pq.write_table(table, OUT / "int96_brotli.parquet", compression="brotli", use_deprecated_int96_timestamps=True)
    pq.write_table(table, OUT / "lz4.parquet", compression="lz4", store_decimal_as_integer=True)


def named_values(columns):
    """A disc speed in which one raw value has the name SNA and the others are scaled, and a gear channel that has only named values."""
    t = columns["time_s"]
    raw = np.round(columns["omega_c_rad_s"] / 0.025).clip(0).astype("u2")
    raw[20:24] = 0xFFFF
    sna = {"val_0": 65535, "text_0": b"SNA", "default_addr": {"a": 0.025, "b": 0.0}}
    gear = {"val_0": 0, "text_0": b"N", "val_1": 1, "text_1": b"1st"}
    signals = [s for s in contract_signals(columns) if s.name != "omega_c_rad_s"]
    signals.append(Signal(raw, t, name="omega_c_rad_s", unit="rad/s", conversion=sna))
    signals.append(Signal((t > 0.2).astype("u1"), t, name="gear", conversion=gear))
    return signals


def expected():
    """Sums and counts per channel, as asammdf reads them back; invalid samples left out."""
    out = {}
    for path in sorted(OUT.glob("*.mf4")):
        if path.stem in ("unfinalised", "unsorted", "named", "frames", "value_blocks"):
            continue
        with MDF(path) as mdf:
            signals = [mdf.get(name, group=g, index=i, ignore_invalidation_bits=False)
                       for name, places in mdf.channels_db.items() for g, i in places if name not in ("time", "t")]  # fmt: skip
            out[path.name] = {s.name: {"count": int(s.samples.size), "sum": float(np.sum(s.samples)), "unit": s.unit} for s in signals}
    return out


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    columns = seed()
    write_seed(columns)
    contract = [(contract_signals(columns), "")]
    plain = save("plain", groups=contract)
    save("deflate", compression=1, groups=contract)
    save("transposed", version="4.20", compression=2, groups=contract)
    save("v430", version="4.30", groups=contract)
    save("fragments", groups=contract, compression=2, fragment=2048)
    save("rates", groups=rates(columns), compression=1)
    two = save("two_groups", groups=rates(columns))
    save("invalid", version="4.11", groups=[(invalid(columns), "")])
    unfinalised = bytearray(plain.read_bytes())
    unfinalised[0:8] = b"UnFinMF "
    unfinalised[60:62] = (1).to_bytes(2, "little")
    (OUT / "unfinalised.mf4").write_bytes(unfinalised)
    two.unlink()
    unsorted(columns)
    value_blocks(plain)
    save("named", groups=[(named_values(columns), "")])
    frames(columns)
    tables(columns)
    more_of_parquet(columns)
    (OUT / "expected.json").write_text(json.dumps(expected(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def unsorted(columns):
    """An unsorted file: the records of two channel groups in one data block, each preceded by its record number, as a logger writes them while recording.

    Made from a sorted file of one group by splitting its records: every second record goes to a second group without the bench channels.
    """
    path = save("unsorted", groups=[(contract_signals(columns), "")])
    data = bytearray(path.read_bytes())
    word = lambda at: int.from_bytes(data[at : at + 8], "little")  # noqa: E731
    group = word(64 + 24)
    channels, block = word(group + 32), word(group + 40)
    size = int.from_bytes(data[channels + 24 + 6 * 8 + 24 : channels + 24 + 6 * 8 + 28], "little")
    records = [data[block + 24 + k * size : block + 24 + (k + 1) * size] for k in range(columns["time_s"].size)]
    # A copy of the channel group with another record number, after the first; both list the same channels.
    length = word(channels + 8)
    second = bytearray(data[channels : channels + length])
    numbers = 24 + 6 * 8
    data[channels + numbers : channels + numbers + 8] = (1).to_bytes(8, "little")
    second[numbers : numbers + 8] = (2).to_bytes(8, "little")
    other = [bytes(r) for r in records[::3]]
    second[numbers + 8 : numbers + 16] = len(other).to_bytes(8, "little")
    second[24:32] = bytes(8)
    data += bytes(-len(data) % 8)
    data[channels + 24 : channels + 32] = len(data).to_bytes(8, "little")
    data += second
    mixed = b"".join(b"\x01" + bytes(r) + (b"\x02" + bytes(r) if k % 3 == 0 else b"") for k, r in enumerate(records))
    data += bytes(-len(data) % 8)
    data[group + 40 : group + 48] = len(data).to_bytes(8, "little")
    data += b"##DT\0\0\0\0" + (24 + len(mixed)).to_bytes(8, "little") + bytes(8) + mixed
    data[group + 24 + 4 * 8] = 1  # bytes of a record's number
    path.write_bytes(data)


def value_blocks(plain):
    """The plain file with its records in two ##DV blocks under an ##LD, as MDF 4.20 allows."""
    data = bytearray(plain.read_bytes())
    word = lambda at: int.from_bytes(data[at : at + 8], "little")  # noqa: E731
    group = word(64 + 24)
    channels, block = word(group + 32), word(group + 40)
    numbers = channels + 24 + 6 * 8
    count, size = word(numbers + 8), int.from_bytes(data[numbers + 24 : numbers + 28], "little")
    records = bytes(data[block + 24 : block + 24 + count * size])
    half = (count + 1) // 2
    places = []
    for part in (records[: half * size], records[half * size :]):
        data += bytes(-len(data) % 8)
        places.append(len(data))
        data += b"##DV\0\0\0\0" + (24 + len(part)).to_bytes(8, "little") + bytes(8) + part
    data += bytes(-len(data) % 8)
    data[group + 40 : group + 48] = len(data).to_bytes(8, "little")
    links = b"".join(at.to_bytes(8, "little") for at in (0, *places))
    body = links + struct.pack("<IIQ", 1, len(places), half)
    data += b"##LD\0\0\0\0" + (24 + len(body)).to_bytes(8, "little") + (len(links) // 8).to_bytes(8, "little") + body
    data[8:12], data[28:30] = b"4.20", (420).to_bytes(2, "little")
    (OUT / "value_blocks.mf4").write_bytes(data)


DBC = """VERSION ""

BO_ 256 Engine: 8 ECU
 SG_ nEngine : 0|16@1+ (0.25,0) [0|16000] "rpm" TCU
 SG_ TqEng : 16|16@1- (0.1,0) [-500|3000] "Nm" TCU

BO_ 512 Clutch: 8 TCU
 SG_ nGbxInput : 0|16@1+ (0.25,0) [0|16000] "rpm" ECU
 SG_ BearingPosSet : 16|16@1+ (0.001,0) [0|60] "mm" ECU

VAL_ 512 nGbxInput 65535 "SNA" ;
"""


def frames(columns):
    """Frames of a CAN bus as MDF4, and their database."""
    (OUT / "frames.dbc").write_text(DBC, encoding="ascii")
    rpm = 30 / math.pi
    raw = lambda name, scale: np.round(columns[name] * scale).astype("i4")  # noqa: E731
    engine = zip(raw("omega_f_rad_s", rpm / 0.25), raw("T_e_Nm", 10))
    clutch = zip(raw("omega_c_rad_s", rpm / 0.25).clip(0), raw("x_to_cmd_mm", 1000))
    with can.Logger(str(OUT / "frames.mf4")) as logger:
        for k, ((n, torque), (disc, position)) in enumerate(zip(engine, clutch)):
            at = 1_790_000_000 + 0.01 * k
            disc = 0xFFFF if k == 50 else disc
            for late, number, (a, b) in [(0.001, 256, (n, torque)), (0.004, 512, (disc, position))]:
                payload = struct.pack("<HhI" if number == 256 else "<HHI", a, b, 0)
                logger.on_message_received(can.Message(timestamp=at + late, arbitration_id=number, is_extended_id=False, data=payload))


if __name__ == "__main__":
    main()
