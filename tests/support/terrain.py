"""Height fields for other libraries."""

import coal


def in_coal(field):
    """Triangles of a height field as a mesh of coal, in the frame of its body."""
    points, corners = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in field.surface[0]:
        points.append(point)
    for triangle in field.surface[1].tolist():
        corners.append(coal.Triangle(*triangle))
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(corners), len(points))
    mesh.addSubModel(points, corners)
    mesh.endModel()
    return mesh
