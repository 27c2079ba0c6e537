"""Run by a python3 with VTK: read temporal VTKHDF files with VTK's own reader, all steps in their order, into FILE.npz each."""
import sys

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader

for path in sys.argv[1:]:
    reader = vtkHDFReader()
    reader.SetFileName(path)
    if not reader.CanReadFile(path):
        sys.exit(f"{path}: VTK cannot read this file")
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    found = {"times": np.array(times)}
    for k, time in enumerate(times or [0.0]):
        reader.UpdateTimeStep(time)
        data = reader.GetOutput()
        if reader.GetErrorCode() or data.GetClassName() != "vtkPolyData":
            sys.exit(f"{path}: VTK cannot read the step of {time}")
        found[f"{k} points"] = vtk_to_numpy(data.GetPoints().GetData()) if data.GetNumberOfPoints() else np.zeros((0, 3))
        cells = [[data.GetCell(c).GetPointId(p) for p in range(data.GetCell(c).GetNumberOfPoints())] for c in range(data.GetNumberOfCells())]
        found[f"{k} cells"] = np.array([point for cell in cells for point in cell])
        found[f"{k} corners"] = np.array([len(cell) for cell in cells])
        for fields in (data.GetPointData(), data.GetCellData()):
            for a in range(fields.GetNumberOfArrays()):
                found[f"{k} {fields.GetArrayName(a)}"] = vtk_to_numpy(fields.GetArray(a))
    np.savez(path + ".npz", **found)
