#!/usr/bin/env python3
"""Read bodies.vtkhdf and contacts.vtkhdf of a run with VTK's own reader and render one step without a window: grains as disks, spheres or,
where bodies have shapes, as they are, contacts as tubes as thick as their normal force, axes and a legend."""
import argparse
import sys
from pathlib import Path
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from palette import CHAINS, SHADES  # noqa: E402
from whole_file import PICTURES, claim, written  # noqa: E402

try:
    import vtk
except ImportError as missing:
    sys.exit(f"render_vtk.py: {missing}; expected a python3 with vtk (pip install vtk)")

#: what a picture begins with
PICTURE = {".png": PICTURES[".png"]}
#: longer side of the picture, and the width of the legend beside it, in points
LONGER, LEGEND = 900, 150
#: shorter side at least
SHORTER = 320
UNITS = {"velocity": "m/s", "spin": "rad/s", "radius": "m", "pressure": "Pa", "mass": "kg"}


def read(path, time):
    """The PolyData of the last step not after `time`, or of the last one."""
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    reader.UpdateTimeStep(max([t for t in times if time is None or t <= time], default=times[0]))
    return reader.GetOutput()


def red_green_blue(text):
    return [int(text[k:k + 2], 16) / 255.0 for k in (1, 3, 5)]


def colour_table():
    """The colours of gravier_plot, which the colour-blind tell apart."""
    ramp = vtk.vtkColorTransferFunction()
    for k, shade in enumerate(SHADES):
        ramp.AddRGBPoint(k / (len(SHADES) - 1.0), *red_green_blue(shade))
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(256)
    table.Build()
    for k in range(256):
        table.SetTableValue(k, *ramp.GetColor(k / 255.0), 1.0)
    table.SetVectorModeToMagnitude()
    return table


def balls(bodies, colour, table, flat):
    """A sphere for each body, a disk in 2D."""
    glyphs = vtk.vtkGlyph3DMapper()
    source = vtk.vtkRegularPolygonSource() if flat else vtk.vtkSphereSource()
    source.SetRadius(1.0)
    if flat:
        source.SetNumberOfSides(48)
    else:
        source.SetThetaResolution(24)
        source.SetPhiResolution(16)
    glyphs.SetSourceConnection(source.GetOutputPort())
    glyphs.SetInputData(bodies)
    glyphs.SetScaleModeToScaleByMagnitude()
    glyphs.SetScaleArray("radius")
    glyphs.SelectColorArray(colour)
    glyphs.SetScalarModeToUsePointFieldData()
    return actor_of(glyphs, bodies.GetPointData(), colour, table)


def surfaces(bodies, colour, table):
    """Bodies with shapes, whose polygons the file has."""
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(bodies)
    mapper.SetScalarModeToUseCellFieldData()
    mapper.SelectColorArray(colour)
    return actor_of(mapper, bodies.GetCellData(), colour, table)


def outlines(bodies):
    """Circles around the disks of a scene in 2D."""
    circle = vtk.vtkRegularPolygonSource()
    circle.SetRadius(1.0)
    circle.SetNumberOfSides(48)
    circle.GeneratePolygonOff()
    glyphs = vtk.vtkGlyph3DMapper()
    glyphs.SetSourceConnection(circle.GetOutputPort())
    glyphs.SetInputData(bodies)
    glyphs.SetScaleModeToScaleByMagnitude()
    glyphs.SetScaleArray("radius")
    glyphs.ScalarVisibilityOff()
    actor = vtk.vtkActor()
    actor.SetMapper(glyphs)
    actor.GetProperty().SetColor(0.5, 0.5, 0.5)
    # above the disks
    actor.SetPosition(0.0, 0.0, 0.02 * bodies.GetPointData().GetArray("radius").GetRange()[0])
    return actor


def spread(values):
    """Least and largest value of the colours: a few extreme bodies must not make all others look alike."""
    sizes = sorted(sum(x * x for x in values.GetTuple(k)) ** 0.5 for k in range(values.GetNumberOfTuples()))
    top = sizes[round(0.98 * (len(sizes) - 1))] or sizes[-1] or 1.0
    return (sizes[0], top) if 0.5 * top < sizes[0] < top else (0.0, top)


def actor_of(mapper, fields, colour, table):
    table.SetTableRange(*spread(fields.GetArray(colour)))
    mapper.SetLookupTable(table)
    mapper.SetScalarRange(table.GetTableRange())
    mapper.UseLookupTableScalarRangeOn()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetEdgeColor(0.4, 0.4, 0.4)
    return actor


def tubes(contacts, widest, height):
    """Tubes of radius `widest` at the largest force, `height` above their places."""
    points = vtk.vtkCellDataToPointData()
    points.SetInputData(contacts)
    points.Update()
    points.GetOutput().GetPointData().SetActiveScalars("normal_force")
    largest = contacts.GetCellData().GetArray("normal_force").GetRange()[1]
    tube = vtk.vtkTubeFilter()
    tube.SetNumberOfSides(8)
    tube.SetVaryRadiusToVaryRadiusByAbsoluteScalar()
    scale = vtk.vtkArrayCalculator()
    scale.SetInputConnection(points.GetOutputPort())
    scale.AddScalarArrayName("normal_force")
    scale.SetFunction(f"normal_force*{widest / max(largest, 1e-300):.17g}")
    scale.SetResultArrayName("thickness")
    tube.SetInputConnection(scale.GetOutputPort())
    tube.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, "thickness")
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(tube.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.SetPosition(0.0, 0.0, height)
    actor.GetProperty().SetColor(red_green_blue(CHAINS))
    return actor


def bounds_of(bodies, fields, flat):
    """Of the bodies with their extents: centres and the largest radius, or polygons."""
    bounds = list(bodies.GetBounds())
    reach = 0.0 if bodies.GetNumberOfPolys() > 0 else fields.GetArray("radius").GetRange()[1]
    for axis in range(2 if flat else 3):
        bounds[2 * axis] -= reach
        bounds[2 * axis + 1] += reach
    return bounds


def axes_of(bounds, camera, flat):
    """Axes with numbers around the scene."""
    axes = vtk.vtkCubeAxesActor() if flat else vtk.vtkCubeAxesActor2D()
    axes.SetBounds(bounds)
    axes.SetCamera(camera)
    axes.SetFlyModeToOuterEdges()
    if not flat:
        axes.SetXLabel("x")
        axes.SetYLabel("y")
        axes.SetZLabel("z")
        axes.SetNumberOfLabels(3)
        axes.SetLabelFormat("%.2g")
        axes.SetFontFactor(0.9)
        axes.SetCornerOffset(0.06)
        texts = [axes.GetAxisTitleTextProperty(), axes.GetAxisLabelTextProperty()]
        lines = [axes.GetProperty()]
    else:
        axes.SetXTitle("x [m]")
        axes.SetYTitle("y [m]")
        axes.SetUse2DMode(True)
        axes.SetZAxisVisibility(False)
        axes.XAxisMinorTickVisibilityOff()
        axes.YAxisMinorTickVisibilityOff()
        texts = [text for k in range(2) for text in (axes.GetTitleTextProperty(k), axes.GetLabelTextProperty(k))]
        lines = [axes.GetXAxesLinesProperty(), axes.GetYAxesLinesProperty()]
    for text in texts:
        text.SetColor(0.2, 0.2, 0.2)
        text.ItalicOff()
        text.BoldOff()
        text.ShadowOff()
    for line in lines:
        line.SetColor(0.45, 0.45, 0.45)
    return axes


def legend_of(table, colour):
    bar = vtk.vtkScalarBarActor()
    bar.SetLookupTable(table)
    unit = UNITS.get(colour)
    bar.SetTitle(f"{'speed' if colour == 'velocity' else colour}{f' [{unit}]' if unit else ''}")
    bar.SetNumberOfLabels(6)
    bar.SetLabelFormat("%.3g")
    bar.UnconstrainedFontSizeOn()
    bar.SetBarRatio(0.25)
    bar.SetPosition(0.05, 0.06)
    bar.SetPosition2(0.9, 0.86)
    bar.SetVerticalTitleSeparation(12)
    for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        text.SetColor(0.1, 0.1, 0.1)
        text.SetFontSize(16)
        text.ItalicOff()
        text.BoldOff()
        text.ShadowOff()
    return bar


def unit_of_axes():
    """Said once, under the legend: titles of axes in space have no room for it."""
    words = vtk.vtkTextActor()
    words.SetInput("axes in m")
    words.SetPosition(30, 12)
    words.GetTextProperty().SetColor(0.1, 0.1, 0.1)
    words.GetTextProperty().SetFontSize(16)
    return words


def set_camera(renderer, bounds, flat):
    """Look at the scene so that it fills the picture, with room for the axes; the width over the height of what it shows."""
    camera = renderer.GetActiveCamera()
    if not flat:
        camera.SetPosition(-1.0, -2.0, 0.8)
        camera.SetFocalPoint(0.0, 0.0, 0.0)
        camera.SetViewUp(0.0, 0.0, 1.0)
        renderer.ResetCamera(bounds)
        camera.Zoom(0.95)
        return 1.0
    width, height = bounds[1] - bounds[0], bounds[3] - bounds[2]
    margin = 0.09 * max(width, height)
    middle = [0.5 * (bounds[0] + bounds[1]) - 0.4 * margin, 0.5 * (bounds[2] + bounds[3]) - 0.4 * margin]
    camera.ParallelProjectionOn()
    camera.SetFocalPoint(*middle, 0.0)
    camera.SetPosition(*middle, 1.0)
    camera.SetViewUp(0.0, 1.0, 0.0)
    aspect = (width + 2.0 * margin) / (height + 2.0 * margin)
    # a long thin scene does not fill a picture of that least side
    shown = min(max(aspect, SHORTER / LONGER), LONGER / SHORTER)
    camera.SetParallelScale(0.5 * (height + 2.0 * margin) * max(1.0, aspect / shown))
    renderer.ResetCameraClippingRange()
    return shown


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path, metavar="DIR", help="output directory of a run with &output vtk = .true.")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.png", help="the picture")
    parser.add_argument("--time", type=float, metavar="T", help="the last written step not after it; the last one unless told")
    parser.add_argument("--colour", default="velocity", metavar="FIELD", help="of the grains (velocity)")
    parser.add_argument("--opacity", type=float, help="of the grains (0.35; 1 in 2D)")
    options = parser.parse_args()
    claim(options.out, PICTURE)

    bodies, contacts = (read(options.directory / name, options.time) for name in ("bodies.vtkhdf", "contacts.vtkhdf"))
    flat, shaped = bodies.GetBounds()[4] == bodies.GetBounds()[5], bodies.GetNumberOfPolys() > 0
    fields, table = bodies.GetCellData() if shaped else bodies.GetPointData(), colour_table()
    renderer, legend = vtk.vtkRenderer(), vtk.vtkRenderer()
    grains = surfaces(bodies, options.colour, table) if shaped else balls(bodies, options.colour, table, flat)
    grains.GetProperty().SetOpacity(options.opacity if options.opacity is not None else 1.0 if flat else 0.35)
    grains.GetProperty().SetEdgeVisibility(shaped)
    if flat:
        grains.GetProperty().LightingOff()
        if not shaped:
            renderer.AddActor(outlines(bodies))
    renderer.AddActor(grains)
    radius = fields.GetArray("radius").GetRange()
    if contacts.GetNumberOfCells() > 0:
        renderer.AddActor(tubes(contacts, (0.1 if shaped else 0.5) * radius[0] * (0.6 if flat else 1.0), 0.1 * radius[0] if flat else 0.0))
    bounds = bounds_of(bodies, fields, flat)
    aspect = set_camera(renderer, bounds, flat)
    renderer.AddActor(axes_of(bounds, renderer.GetActiveCamera(), flat))
    width, height = (LONGER, round(LONGER / aspect)) if aspect >= 1.0 else (round(LONGER * aspect), LONGER)
    legend.AddActor(legend_of(table, options.colour))
    if not flat:
        legend.AddActor(unit_of_axes())
    renderer.SetViewport(0.0, 0.0, width / (width + LEGEND), 1.0)
    legend.SetViewport(width / (width + LEGEND), 0.0, 1.0, 1.0)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(width + LEGEND, height)
    for part in (renderer, legend):
        part.SetBackground(1.0, 1.0, 1.0)
        window.AddRenderer(part)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    writer = vtk.vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    with written(options.out, PICTURE) as part:
        writer.SetFileName(str(part))
        writer.Write()
    print(options.out)


if __name__ == "__main__":
    main()
