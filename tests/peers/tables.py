"""Tables (CSV, Parquet) as other programs read them, held against the logs that they were made of."""

import csv
import json

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from logs import Log, near, nanoseconds


def check_table(path, log_path):
    """Every cell of a table by duckdb, pyarrow and Python's csv, against the log."""
    log = Log(log_path)
    pings = [ping for scan in log.scans for ping in scan["pings"]]
    rows = list(csv.DictReader(open(path, encoding="utf-8", newline="")))
    arrow = pyarrow.csv.read_csv(path)
    duck = duckdb.sql(f"SELECT count(*), sum(range_m), count(range_m), sum(sim_range_m::DOUBLE) FROM read_csv('{path}', sample_size=-1)")
    ranges = [ping["range_m"] for ping in pings if ping["range_m"] is not None]
    predicted = [ping["sim"]["range_m"] for ping in pings if ping.get("sim") and ping["sim"]["range_m"] is not None]
    count, total, echoes, of_sim = duck.fetchall()[0]
    assert (count, echoes) == (len(pings), len(ranges)) and near(float(total), sum(ranges))
    assert near(float(of_sim or 0), sum(predicted))
    assert arrow.num_rows == len(rows) == len(pings)
    assert near(sum(x for x in arrow["range_m"].to_pylist() if x is not None), sum(ranges))
    for row, ping in zip(rows, pings):
        for name, value in ping.items():
            if name in row and name != "path":
                expected_value = " ".join(map(str, value)) if isinstance(value, list) else "" if value is None else value
                cell = row[name]
                assert (float(cell) == expected_value if isinstance(expected_value, float) else cell == str(expected_value)), (name, cell, expected_value)
        for name, value in (ping.get("sim") or {}).items():
            if f"sim_{name}" in row and name != "path":
                cell = row[f"sim_{name}"]
                assert (cell == "" if value is None else cell == value or float(cell) == value), (name, cell)
    print(f"{path}: {len(rows)} rows, read alike by three")


SINGLE = {"range_m", "tof_us", "amplitude", "margin_db", "path_length_m"}
SINGLE |= {f"sim_{name}" for name in SINGLE - {"tof_us"}} | {"residual_m", "confidence"}
TEXT = {"log", "provenance", "scene", "sensor", "array", "scan", "ranger", "status", "path_kind", "path",
        "crosstalk_ranger", "sim_status", "sim_path_kind", "sim_path", "sim_crosstalk_ranger"}
TIME = {"session_started", "scan_started", "time"}
WHOLE = {"session", "collection_pose", "collection_repeat", "index", "step", "fired_ticks", "path_order", "sim_path_order"}


def type_of(name):
    if name in SINGLE:
        return pa.float32()
    if name in TEXT:
        return pa.string()
    if name in TIME:
        return pa.timestamp("ns", tz="UTC")
    if name in WHOLE:
        return pa.int64()
    counts = pa.list_(pa.field("element", pa.uint32(), nullable=False))
    return {"echo_ticks": counts, "repaired": pa.bool_()}.get(name, pa.float64())


def cells_of_log(log, scan, ping):
    """Expected values of a row by column name, without those of the geometry."""
    session, start, sim = log.session, scan["start"], ping.get("sim") or {}
    pose = ping.get("pose") or start["pose"]
    air = start.get("air") or session["air"]
    cells = {name: None for name in TEXT | SINGLE | TIME | WHOLE}
    nested = ("type", "sim", "path", "pose", "crosstalk")
    cells |= {name: ping.get(name) for name in ping if name not in nested}
    cells |= {f"sim_{name}": value for name, value in sim.items() if name not in nested}
    for prefix, of in [("", ping), ("sim_", sim)]:
        for name in ("ranger", "before_us"):
            cells[f"{prefix}crosstalk_{name}"] = (of.get("crosstalk") or {}).get(name)
    for prefix, path in [("", ping.get("path")), ("sim_", sim.get("path"))]:
        if path:
            cells |= {f"{prefix}path_{name}": path[name] for name in ("kind", "order")}
            cells[f"{prefix}path_length_m"] = path["length_m"]
    cells |= {name: pose[name] for name in ("x_m", "y_m", "heading_deg")}
    cells |= {"session": 1, "session_started": session["started"], "scan": start["scan"], "scan_started": start["time"]}
    cells |= {name: (session.get(name) or {}).get("name") for name in ("scene", "sensor", "array")}
    cells |= {name: air[name] for name in ("temperature_c", "sound_speed_m_s")}
    cells["provenance"] = ping.get("provenance") or session["provenance"]
    cells.setdefault("repaired", False)
    for name in TIME:
        cells[name] = cells[name] and nanoseconds(cells[name])
    for name in SINGLE:
        cells[name] = None if cells[name] is None else float(np.float32(cells[name]))
    return cells


# What the log has in other words or not in one field: held against the table as text.
DERIVED = {"log", "path", "sim_path", "transducer_x_m", "transducer_y_m", "transducer_z_m", "direction_deg", "tilt_deg"}


def check_typed_table(path, log_path):
    """Every cell of a table in Parquet by pyarrow and by duckdb, against the log and against the same table as text."""
    log = Log(log_path)
    file = pyarrow.parquet.ParquetFile(path)
    table = file.read()
    for field in table.schema:
        assert field.type == type_of(field.name), field
    moments = [name for name in table.column_names if name in TIME]
    for name in moments:
        table = table.set_column(table.column_names.index(name), name, table[name].cast(pa.int64()))
    rows = table.to_pylist()
    db = duckdb.connect()
    quoted = [f'"{name}"' for name in table.column_names]
    columns = ", ".join(
        f"epoch_ns({quoted}::TIMESTAMP_NS) AS {quoted}" if name in TIME else quoted
        for name, quoted in zip(table.column_names, quoted)
    )
    found = db.sql(f"SELECT {columns} FROM read_parquet('{path}')")
    by_duckdb = [dict(zip(found.columns, row)) for row in found.fetchall()]
    text = list(csv.DictReader(open(path.with_suffix(".csv"), encoding="utf-8", newline="")))
    pings = [(scan, ping) for scan in log.scans for ping in scan["pings"]]
    assert len(rows) == len(by_duckdb) == len(text) == len(pings)
    assert list(text[0]) == table.column_names == file.schema_arrow.names
    for row, other, line, (scan, ping) in zip(rows, by_duckdb, text, pings):
        expected = cells_of_log(log, scan, ping)
        for name, cell in row.items():
            # duckdb has times with a zone to the microsecond.
            agree = cell // 1000 == other[name] // 1000 if name in TIME and cell is not None else cell == other[name]
            assert agree, (name, cell, other[name])
            if name in DERIVED:
                value = line[name]
                assert (cell or "") == value if name in TEXT else cell == (float(value) if value else None), (name, cell, value)
            else:
                assert cell == expected.get(name), (name, cell, expected.get(name))
    metadata = {key.decode(): value.decode() for key, value in file.metadata.metadata.items()}
    by_duckdb = db.sql(f"SELECT key, value FROM parquet_kv_metadata('{path}')").fetchall()
    assert {bytes(key).decode(): bytes(value).decode() for key, value in by_duckdb} == metadata
    session = json.loads(metadata["sonard.session.1"])
    scene = log.session.get("scene_text")
    assert session == {key: value for key, value in log.session.items() if key not in ("type", "scene_text")}
    assert scene is None or metadata[f"sonard.scene.{session['scene']['sha256']}"] == scene
    size = path.stat().st_size / len(rows)
    print(f"{path}: {len(rows)} rows, {size:.0f} bytes each, read alike by both")
