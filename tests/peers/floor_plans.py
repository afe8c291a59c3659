#!/usr/bin/env python3
"""Floor plans as the formats' own tools read them, held against the scenes that sonard makes of the same files.

    tests/peers/floor_plans.py PROGRAM

DXF by ezdxf, SVG by svgelements, clip paths by shapely, maps by the rules in the documentation of ROS's map_server, poses in
Gazebo worlds by numpy. Random plans of a fixed seed; for each the difference of the total wall length and the Hausdorff
distance between both sets of walls, metres, are printed. Curves may deviate by a millimetre, walls of maps by half a cell.
"""

import json
import math
import os
import random
import subprocess
import sys
import tempfile

import ezdxf
import ezdxf.disassemble
import ezdxf.path
import numpy
import shapely
import svgelements

PLANS = 12
# Points along a line that a Hausdorff distance is taken between, metres.
STEP_M = 0.02


def scene_lines(program, verb, path, *options):
    """Walls of a scene as a line geometry; cylinders as their outlines."""
    made = subprocess.run([program, "scene", verb, path, *options], capture_output=True, text=True, timeout=600)
    if made.returncode:
        sys.exit(f"{path}: {made.stderr}")
    scene = json.loads(made.stdout)
    lines = []
    for wall in scene.get("walls", []):
        corners = wall.get("polyline") or [wall["from"], wall["to"]]
        lines.append([*corners, corners[0]] if wall.get("closed") else corners)
    for one in scene.get("cylinders", []):
        angles = numpy.linspace(0, math.tau, 361)
        lines.append(numpy.array(one["center"]) + one["radius_m"] * numpy.stack([numpy.cos(angles), numpy.sin(angles)], axis=1))
    return shapely.multilinestrings([shapely.linestrings(numpy.array(line, float)) for line in lines])


def points(lines):
    return shapely.get_coordinates(shapely.segmentize(lines, STEP_M))


def hausdorff(ours, most, least):
    """Greatest distance of a point of our walls to the most that the tool may show, and of the least to ours."""
    distances = [shapely.distance(shapely.points(points(one)), other).max() for one, other in ((ours, most), (least, ours))]
    return float(max(distances))


class Report:
    def __init__(self):
        self.failures = []
        print(f"{'plans':<40} {'walls, m':>10} {'length, %':>10} {'apart, mm':>10} {'allowed':>8}")

    def add(self, name, pairs, allowed_m):
        """Prints the greatest differences of pairs of line geometries; a third one is the least that must be found."""
        length = sum(theirs.length for _, theirs, *_ in pairs)
        share = max(abs(ours.length - theirs.length) / theirs.length for ours, theirs, *_ in pairs)
        apart_m = max(hausdorff(ours, theirs, *(least or [theirs])) for ours, theirs, *least in pairs)
        print(f"{name:<40} {length:>10.1f} {100 * share:>10.3f} {1000 * apart_m:>10.3f} {1000 * allowed_m:>8.1f}")
        if apart_m > allowed_m:
            self.failures.append(f"{name}: {1000 * apart_m:.3f} mm apart")


# DXF.

def random_dxf(path, rng, form):
    drawing = ezdxf.new("R2010")
    drawing.units = 4
    drawing.layers.add("WALLS")
    frozen = drawing.layers.add("FURNITURE")
    frozen.freeze()
    drawing.layers.add("Off").off()
    space = drawing.modelspace()
    somewhere = lambda: (rng.uniform(0, 9000), rng.uniform(0, 7000))

    def fill(target, layer):
        a, b = somewhere(), somewhere()
        target.add_line(a, b, dxfattribs={"layer": layer})
        corners = [(*somewhere(), rng.choice([0, 0, 0.4, -1.2])) for _ in range(rng.randint(3, 6))]
        target.add_lwpolyline(corners, format="xyb", close=rng.random() < 0.5, dxfattribs={"layer": layer})
        target.add_arc(somewhere(), rng.uniform(200, 1500), rng.uniform(0, 360), rng.uniform(0, 360), dxfattribs={"layer": layer})
        target.add_circle(somewhere(), rng.uniform(100, 400), dxfattribs={"layer": layer})
        target.add_solid([somewhere() for _ in range(3)], dxfattribs={"layer": layer})
        target.add_polyline2d([somewhere() for _ in range(4)], dxfattribs={"layer": layer})

    space.add_lwpolyline([(0, 0), (10000, 0), (10000, 8000), (0, 8000)], close=True, dxfattribs={"layer": "WALLS"})
    fill(space, "WALLS")
    fill(space, "FURNITURE")
    fill(space, "off")
    block = drawing.blocks.new("DOOR", base_point=(rng.uniform(0, 500), 0))
    fill(block, "0")
    inner = drawing.blocks.new("HANDLE")
    inner.add_circle((0, 0), 150)
    block.add_blockref("HANDLE", (800, 300), dxfattribs={"xscale": 2, "yscale": 2, "rotation": 30})
    for _ in range(3):
        size = rng.uniform(0.1, 0.4)
        space.add_blockref("DOOR", somewhere(), dxfattribs={
            "layer": "WALLS", "rotation": rng.uniform(0, 360), "xscale": size * rng.choice([1, -1]), "yscale": size})
    # What is left out, and what the drawing's other parts hold.
    space.add_hatch().paths.add_polyline_path([somewhere() for _ in range(3)])
    space.add_text("room")
    space.add_spline([somewhere() for _ in range(4)])
    drawing.layout("Layout1").add_line((0, 0), (1, 1))
    drawing.saveas(path, fmt=form)


def ezdxf_lines(path):
    """All visible lines of a drawing, metres."""
    drawing = ezdxf.readfile(path)
    hidden = {layer.dxf.name.lower() for layer in drawing.layers if layer.is_frozen() or layer.is_off()}
    lines = []

    def add(entity, layer):
        own = entity.dxf.layer.lower()
        own = layer if own == "0" and layer else own
        if own in hidden:
            return
        if entity.dxftype() == "INSERT":
            for part in entity.virtual_entities():
                add(part, own)
        elif entity.dxftype() == "SOLID":
            corners = [(corner.x, corner.y) for corner in entity.wcs_vertices()]
            lines.append([*corners, corners[0]])
        elif entity.dxftype() in ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE"):
            flat = [(corner.x, corner.y) for corner in ezdxf.path.make_path(entity).flattening(0.1)]
            lines.append(flat)

    for entity in drawing.modelspace():
        add(entity, "")
    unit_m = ezdxf.units.conversion_factor(drawing.units, ezdxf.units.M)
    return shapely.multilinestrings([shapely.linestrings(unit_m * numpy.array(line)) for line in lines if len(line) > 1])


# SVG.

def random_svg(path, rng, clipped):
    number = lambda low, high: f"{rng.uniform(low, high):.2f}"
    place = lambda: f"{number(5, 95)},{number(5, 75)}"

    def shapes():
        yield f"<line x1='{number(5, 95)}' y1='{number(5, 75)}' x2='{number(5, 95)}' y2='{number(5, 75)}'/>"
        yield f"<polyline points='{place()} {place()} {place()}'/>"
        yield f"<polygon points='{place()} {place()} {place()}'/>"
        yield f"<rect x='{number(5, 60)}' y='{number(5, 50)}' width='{number(5, 30)}' height='{number(5, 20)}'/>"
        yield f"<ellipse cx='{number(30, 70)}' cy='{number(30, 50)}' rx='{number(5, 20)}' ry='{number(5, 20)}'/>"
        yield f"<path d='M {place()} C {place()} {place()} {place()} L {place()} Q {place()} {place()} Z'/>"
        yield f"<path d='M {place()} A {number(10, 30)} {number(10, 30)} {number(0, 90)} 0 1 {place()}'/>"

    def transform():
        return rng.choice([
            f"translate({number(-3, 3)},{number(-3, 3)})", f"rotate({number(-20, 20)} 50 40)", f"scale({number(0.7, 1)})",
            f"matrix(0.9 {number(-0.1, 0.1)} {number(-0.1, 0.1)} 0.9 2 2)", f"skewX({number(-5, 5)})",
        ])

    groups = "".join(f"<g transform='{transform()}'><g transform='{transform()}'>{''.join(shapes())}</g></g>" for _ in range(2))
    hidden = "<g style='display:none'><line x1='0' y1='0' x2='100' y2='80'/></g>"
    marker = "<defs><marker id='m' viewBox='0 0 4 4'><path d='M 0 0 L 4 2 L 0 4'/></marker></defs><path marker-end='url(#m)' d='M 10 10 L 20 10'/>"
    clip, attribute = "", ""
    corners = [(rng.uniform(5, 45), rng.uniform(5, 35)), (rng.uniform(55, 95), rng.uniform(5, 35)),
               (rng.uniform(55, 95), rng.uniform(45, 75)), (rng.uniform(5, 45), rng.uniform(45, 75))]
    if clipped:
        clip = f"<clipPath id='c'><polygon points='{' '.join(f'{x:.3f},{y:.3f}' for x, y in corners)}'/></clipPath>"
        attribute = " clip-path='url(#c)'"
    drawing = (
        "<?xml version='1.0'?>\n<!DOCTYPE svg PUBLIC '-//W3C//DTD SVG 1.1//EN' 'http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd'>\n"
        "<svg xmlns='http://www.w3.org/2000/svg' width='200mm' height='160mm' viewBox='0 0 100 80' fill='none' stroke='black'>"
        f"{clip}<g{attribute}>{groups}</g>{'' if clipped else hidden + marker}</svg>"
    )
    with open(path, "w") as file:
        file.write(drawing)
    return corners


def svgelements_lines(path, width_m):
    """All visible lines of a drawing, metres, with y up."""
    drawing = svgelements.SVG.parse(path, reify=False, ppi=96)
    scale = width_m / float(drawing.width)
    lines = []
    for element in drawing.elements(conditional=lambda one: one.values.get("display") != "none"):
        if not isinstance(element, svgelements.Shape):
            continue
        # Points are transformed, not curves: svgelements keeps arcs elliptical about wrong axes when they are skewed.
        outline, transform = svgelements.Path(element), element.transform
        outline.transform = svgelements.Matrix()
        for part in outline.as_subpaths():
            flat = []
            for segment in svgelements.Path(part):
                if isinstance(segment, svgelements.Move):
                    continue
                count = 2 if isinstance(segment, (svgelements.Line, svgelements.Close)) else 400
                flat += [transform.point_in_matrix_space(segment.point(at)) for at in numpy.linspace(0, 1, count)]
            flat = [(scale * point.x, scale * (float(drawing.height) - point.y)) for point in flat if point is not None]
            if len(flat) > 1:
                lines.append(shapely.linestrings(flat))
    return shapely.multilinestrings(lines)


def clipped_lines(lines, corners, width_m):
    """Lines within a polygon that is a curve's tolerance larger, and smaller."""
    polygon = shapely.Polygon([(width_m / 100 * x, width_m / 100 * (80 - y)) for x, y in corners])
    return [shapely.intersection(lines, polygon.buffer(margin_m)) for margin_m in (2e-3, -2e-3)]


# Maps.

def random_map(folder, rng, variant):
    """A room with walls of one and more cells; returns the boundary between occupied and free cells."""
    width, height, resolution = rng.randint(60, 90), rng.randint(50, 80), rng.choice([0.05, 0.1])
    free, occupied, unknown = {"scale": (254, 0, 205), "raw": (0, 100, 255), "negate": (1, 255, 50)}.get(variant, (254, 0, 205))
    cells = numpy.full((height, width), unknown, dtype=int)
    cells[5:-5, 5:-5] = free
    for edge in (numpy.s_[5, 5:-5], numpy.s_[-6, 5:-5], numpy.s_[5:-5, 5], numpy.s_[5:-5, -6]):
        cells[edge] = occupied
    for _ in range(4):
        row, column, length, thick = rng.randint(10, height - 20), rng.randint(10, width - 20), rng.randint(4, 9), rng.randint(1, 3)
        if rng.random() < 0.5:
            cells[row:row + thick, column:column + length] = occupied
        else:
            cells[row:row + length, column:column + thick] = occupied
    yaw = rng.uniform(-3, 3) if variant == "yaw" else 0.0
    origin = (rng.uniform(-9, 9), rng.uniform(-9, 9))
    with open(os.path.join(folder, "map.pgm"), "wb") as file:
        file.write(b"P5\n%d %d\n255\n" % (width, height) + bytes(cells.astype(numpy.uint8).tobytes()))
    with open(os.path.join(folder, "map.yaml"), "w") as file:
        mode = variant if variant in ("scale", "raw") else "trinary"
        file.write(f"image: map.pgm\nmode: {mode}\nresolution: {resolution}\norigin:\n- {origin[0]}\n- {origin[1]}\n- {yaw}\n"
                   f"negate: {int(variant == 'negate')}\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    # map_server: darkness, or its inverse, against the thresholds; raw values are occupancies.
    shade = cells if variant == "negate" else 255 - cells
    is_occupied = (cells == 100) if variant == "raw" else shade / 255 > 0.65
    is_free = (cells == 0) if variant == "raw" else shade / 255 < 0.196
    lines = []
    corner = lambda row, column: (column * resolution, (height - row) * resolution)
    for row in range(height):
        for column in range(width):
            if not is_occupied[row, column]:
                continue
            sides = [((row - 1, column), (row, column), (row, column + 1)), ((row + 1, column), (row + 1, column), (row + 1, column + 1)),
                     ((row, column - 1), (row, column), (row + 1, column)), ((row, column + 1), (row, column + 1), (row + 1, column + 1))]
            for (other_row, other_column), *ends in sides:
                if 0 <= other_row < height and 0 <= other_column < width and is_free[other_row, other_column]:
                    lines.append([corner(*end) for end in ends])
    turned = numpy.array(lines) @ numpy.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]]) + origin
    return shapely.multilinestrings([shapely.linestrings(line) for line in turned]), resolution


# Worlds.

def pose_matrix(x, y, z, roll, pitch, yaw):
    turns = []
    for axis, angle in ((0, roll), (1, pitch), (2, yaw)):
        sin, cos = math.sin(angle), math.cos(angle)
        turn = numpy.eye(3)
        others = [one for one in range(3) if one != axis]
        turn[numpy.ix_(others, others)] = [[cos, -sin], [sin, cos]] if axis != 1 else [[cos, sin], [-sin, cos]]
        turns.append(turn)
    matrix = numpy.eye(4)
    matrix[:3, :3] = turns[2] @ turns[1] @ turns[0]
    matrix[:3, 3] = x, y, z
    return matrix


def random_world(path, rng):
    """Boxes in nested, turned models, some relative to others; returns the outlines of their slices."""
    pose = lambda: (rng.uniform(-5, 5), rng.uniform(-5, 5), 0.0, 0.0, 0.0, rng.uniform(-3, 3))
    words = lambda values: " ".join(f"{value:.6f}" for value in values)
    text, lines, models = "", [], {}

    def box(name, matrix, own, size):
        corners = [(sx * size[0] / 2, sy * size[1] / 2) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))]
        lines.append([(matrix @ (x, y, 0, 1))[:2] for x, y in corners])
        return (f"<link name='link'><pose>{words(own)}</pose><collision name='c'><geometry><box><size>{words(size)}</size></box>"
                "</geometry></collision></link>")

    for at in range(5):
        outer, own, inner, inner_own = pose(), pose(), pose(), pose()
        size, inner_size = (rng.uniform(0.5, 3), rng.uniform(0.1, 1), 2.0), (rng.uniform(0.5, 3), rng.uniform(0.1, 1), 2.0)
        base, attribute = numpy.eye(4), ""
        if at >= 3:
            base, attribute = models[f"m{at - 3}"], f" relative_to='m{at - 3}'"
        models[f"m{at}"] = base @ pose_matrix(*outer)
        placed = models[f"m{at}"] @ pose_matrix(*inner)
        text += (f"<model name='m{at}'><static>true</static><pose{attribute}>{words(outer)}</pose>"
                 f"{box(at, models[f'm{at}'] @ pose_matrix(*own), own, size)}"
                 f"<model name='inner'><pose>{words(inner)}</pose>{box(at, placed @ pose_matrix(*inner_own), inner_own, inner_size)}</model></model>")
    with open(path, "w") as file:
        file.write(f"<?xml version='1.0'?><sdf version='1.9'><world name='w'>{text}</world></sdf>")
    return shapely.multilinestrings([shapely.linestrings(numpy.array(line)) for line in lines])


def main():
    program, rng, report = os.path.abspath(sys.argv[1]), random.Random(2026), Report()
    with tempfile.TemporaryDirectory() as folder:
        path = lambda name: os.path.join(folder, name)
        for form, name in (("asc", "DXF, ASCII, by ezdxf"), ("bin", "DXF, binary, by ezdxf")):
            pairs = []
            for at in range(PLANS):
                random_dxf(path("a.dxf"), rng, form)
                pairs.append((scene_lines(program, "from-dxf", path("a.dxf")), ezdxf_lines(path("a.dxf"))))
            # Walls of large arcs are a degree long.
            report.add(name, pairs, 3e-3)
        for clipped, name in ((False, "SVG, by svgelements"), (True, "SVG, clipped, by svgelements and shapely")):
            pairs = []
            for at in range(PLANS):
                corners = random_svg(path("a.svg"), rng, clipped)
                ours = scene_lines(program, "from-svg", path("a.svg"), "--width-m", "10")
                theirs = svgelements_lines(path("a.svg"), 10.0)
                pairs.append((ours, *(clipped_lines(theirs, corners, 10.0) if clipped else [theirs])))
            report.add(name, pairs, 3e-3)
        for variant in ("trinary", "scale", "raw", "negate", "yaw"):
            pairs, cell_m = [], 0.0
            for at in range(PLANS):
                theirs, resolution = random_map(folder, rng, variant)
                ours = scene_lines(program, "from-grid", path("map.yaml"), "--min-length-m", "0")
                pairs.append((ours, theirs))
                cell_m = max(cell_m, resolution)
            report.add(f"map, {variant}, by map_server's rules", pairs, cell_m / 2)
        pairs = []
        for at in range(PLANS):
            theirs = random_world(path("a.sdf"), rng)
            pairs.append((scene_lines(program, "from-sdf", path("a.sdf")), theirs))
        report.add("SDF, poses by numpy", pairs, 1e-3)
    sys.exit("\n".join(report.failures) or 0)


if __name__ == "__main__":
    main()
