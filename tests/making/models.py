"""Makes models for tests that need one and no recording."""

from __future__ import annotations

import numpy as np

from tablemap import model as m


def rectangle_model(
    *,
    x: float = 0.31,
    y: float = -0.22,
    yaw: float = 0.37,
    length: float = 1.187,
    width: float = 0.806,
    height: float = 0.743,
    sigma: float = 0.002,
    legs: int = 4,
) -> m.TableModel:
    """Return a rectangle with up to four round legs of 5 cm, 7 cm inside the corners."""
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s], [s, c]])
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    corners = signs * [length / 2, width / 2] @ turn.T + [x, y]
    places = signs * [length / 2 - 0.07, width / 2 - 0.07] @ turn.T + [x, y]
    outline = tuple((float(a), float(b)) for a, b in corners)
    return m.TableModel(
        frame="map",
        floor_z=0.0,
        surface=m.TableSurface(
            shape="rectangle",
            pose=m.SurfacePose(
                x=x,
                y=y,
                yaw=yaw,
                covariance=((sigma**2, 0.0, 0.0), (0.0, sigma**2, 0.0), (0.0, 0.0, sigma**2)),
            ),
            height=m.Figure(value=height, sigma=sigma),
            thickness=None,
            dimensions={
                "length": m.Dimension(value=length, sigma=sigma, status="measured"),
                "width": m.Dimension(value=width, sigma=sigma, status="measured"),
            },
            corner_radius=None,
            outline=outline,
            edges=tuple(
                m.Edge(
                    points=(outline[i], outline[(i + 1) % 4]),
                    status="measured",
                    sigma=sigma,
                    seen_fraction=0.9,
                )
                for i in range(4)
            ),
            score=0.98,
            alternatives=(m.Alternative(shape="ellipse", score=0.01),),
        ),
        legs=tuple(
            m.TableLeg(
                shape="circle",
                x=float(px),
                y=float(py),
                yaw=0.0,
                status="measured",
                position_sigma=0.003,
                dimensions={"diameter": m.Dimension(value=0.05, sigma=0.001, status="measured")},
            )
            for px, py in places[:legs]
        ),
        snapshots=tuple(
            m.SnapshotPose(
                stamp_ns=10**18 + i * 10**9,
                map_from_base=m.PlanarPose(
                    x=x + 1.5 * np.cos(i), y=y + 1.5 * np.sin(i), yaw=float(i) - 3.0
                ),
                sigma=m.PoseSigma(xy=0.001, yaw=0.0005),
                used=True,
                reason=None,
            )
            for i in range(6)
        ),
        verdict=m.Verdict(level="good", reasons=()),
        warnings=(),
    )
