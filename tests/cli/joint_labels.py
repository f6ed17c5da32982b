"""Label images of joints: label 1 a talus-like block, label 2 a shaft that the image cuts off, by `cut` voxels lower from one to the next.
   labels.py OUT_DIR COUNT CUT"""
import math
import sys

out, count, cut = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
for i in range(count):
    nx, ny, nz = 44, 40, 70 - (cut * i if cut else 0)
    t = 0.06 * (i - count / 2)  # the shaft leans
    data = bytearray(nx * ny * nz)
    for z in range(nz):
        for y in range(ny):
            for x in range(nx):
                X, Y, Z = x - 22, y - 20, z - 14
                a = (X / (13 + 0.5 * i)) ** 2 * (1 + (X > 0)) + (Y / 10) ** 2 + (Z / 8) ** 2 + 0.1 * X * Z / 80
                k = 0
                if a < 1:
                    k = 1
                elif z > 24:
                    u = X - t * (z - 24)
                    r = 7 + 4 * math.exp(-(z - 24) / 8) + (0 if cut else -6 * max(0, (z - 58) / 10) ** 2)
                    if r > 0 and u * u * (1 + 2 * (u > 0)) + Y * Y * 1.5 < r * r:
                        k = 2
                data[(z * ny + y) * nx + x] = k
    with open(f"{out}/s{i}.nrrd", "wb") as f:
        f.write(f"NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: {nx} {ny} {nz}\n"
                "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\n\n".encode())
        f.write(bytes(data))
