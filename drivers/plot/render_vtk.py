#!/usr/bin/env python3
"""Read bodies.vtkhdf and contacts.vtkhdf of a run with VTK's own reader and render one step without a window: grains as spheres or,
where bodies have shapes, as they are, contacts as tubes as thick as their normal force."""
import argparse
import sys
from pathlib import Path
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import whole_file  # noqa: E402

try:
    import vtk
except ImportError as missing:
    sys.exit(f"render_vtk.py: {missing}; expected a python3 with vtk (pip install vtk)")


def read(path, time):
    """The PolyData of the last step not after `time`, or of the last one."""
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    reader.UpdateTimeStep(max([t for t in times if time is None or t <= time], default=times[0]))
    return reader.GetOutput()


def spheres(bodies, colour, table):
    glyphs = vtk.vtkGlyph3DMapper()
    source = vtk.vtkSphereSource()
    source.SetRadius(1.0)
    source.SetThetaResolution(24)
    source.SetPhiResolution(16)
    glyphs.SetSourceConnection(source.GetOutputPort())
    glyphs.SetInputData(bodies)
    glyphs.SetScaleModeToScaleByMagnitude()
    glyphs.SetScaleArray("radius")
    glyphs.SelectColorArray(colour)
    glyphs.SetScalarModeToUsePointFieldData()
    table.SetVectorModeToMagnitude()
    glyphs.SetLookupTable(table)
    glyphs.SetScalarRange(bodies.GetPointData().GetArray(colour).GetRange(-1))
    actor = vtk.vtkActor()
    actor.SetMapper(glyphs)
    return actor


def surfaces(bodies, colour, table):
    """Bodies with shapes, whose polygons the file has."""
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(bodies)
    mapper.SetScalarModeToUseCellFieldData()
    mapper.SelectColorArray(colour)
    table.SetVectorModeToMagnitude()
    mapper.SetLookupTable(table)
    mapper.SetScalarRange(bodies.GetCellData().GetArray(colour).GetRange(-1))
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().EdgeVisibilityOn()
    actor.GetProperty().SetEdgeColor(0.3, 0.3, 0.3)
    return actor


def tubes(contacts, widest):
    """Tubes of radius `widest` at the largest force."""
    points = vtk.vtkCellDataToPointData()
    points.SetInputData(contacts)
    points.Update()
    points.GetOutput().GetPointData().SetActiveScalars("normal_force")
    largest = contacts.GetCellData().GetArray("normal_force").GetRange()[1]
    tube = vtk.vtkTubeFilter()
    tube.SetInputConnection(points.GetOutputPort())
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
    actor.GetProperty().SetColor(0.70, 0.09, 0.17)
    return actor


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path, metavar="DIR", help="output directory of a run with &output vtk = .true.")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.png", help="the picture")
    parser.add_argument("--time", type=float, metavar="T", help="the last written step not after it; the last one unless told")
    parser.add_argument("--colour", default="velocity", metavar="FIELD", help="of the grains (velocity)")
    parser.add_argument("--opacity", type=float, default=0.35, help="of the grains (0.35)")
    options = parser.parse_args()

    bodies, contacts = (read(options.directory / name, options.time) for name in ("bodies.vtkhdf", "contacts.vtkhdf"))
    table = vtk.vtkLookupTable()
    table.SetHueRange(0.62, 0.55)
    table.SetSaturationRange(0.1, 1.0)
    table.SetValueRange(1.0, 0.6)
    table.Build()
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1.0, 1.0, 1.0)
    shaped = bodies.GetNumberOfPolys() > 0
    grains = (surfaces if shaped else spheres)(bodies, options.colour, table)
    grains.GetProperty().SetOpacity(options.opacity)
    renderer.AddActor(grains)
    fields = bodies.GetCellData() if shaped else bodies.GetPointData()
    if contacts.GetNumberOfCells() > 0:
        renderer.AddActor(tubes(contacts, (0.1 if shaped else 0.5) * fields.GetArray("radius").GetRange()[0]))
    low_x, high_x, low_y, high_y, low_z, high_z = bodies.GetBounds()
    if high_z > low_z:
        renderer.GetActiveCamera().SetPosition(-1.0, -2.0, 0.8)
        renderer.GetActiveCamera().SetFocalPoint(0.0, 0.0, 0.0)
        renderer.GetActiveCamera().SetViewUp(0.0, 0.0, 1.0)
    renderer.ResetCamera()
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(800, 600)
    window.AddRenderer(renderer)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    writer = vtk.vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    with whole_file(options.out) as part:
        writer.SetFileName(str(part))
        writer.Write()
    print(options.out)


if __name__ == "__main__":
    main()
