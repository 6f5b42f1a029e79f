"""The contents of a review file: all entities, so that old files are readable without this program.

Each file has the name below as ``property:review:schema``, the entities as
``property:review:entities``, and the snapshot that a viewer begins with as
``property:first_view:snapshot``. If the meaning of an entity changes, the schema gets a new number.
"""

from __future__ import annotations

SCHEMA = "tablemap/review/3"

TIMELINES = {
    "sensor_time": "the recording's clock, nanoseconds; what holds throughout is at its start",
    "snapshot": "number of the stop, from 0; results hold from 0 on",
    "stage": "0 while the recording is opened, then the pipeline's stages from 1",
    "iteration": "of the pairs' ICP, 0 where each began; all else is at 0",
}

ENTITIES = {
    "/": "ViewCoordinates: right-handed, z up; metres",
    "/summary": "TextDocument: verdict and figures; or why there is no model",
    "/**/names": "Points3D or Points2D without size: the texts that name what lies above",
    "/**/leaders": "LineStrips3D: from what is named to names that stand aside",
    "/legend/*/*": "Points2D, static: what the colours of a tab mean; drawn below its view",
    "/stop/*": "one row a snapshot: camera and points of that stop, in its own colour",
    "/story/*": "by stage what there was before a model: stops, candidates, edges, top; then "
    "empty; in a run that failed also found: the names of the surfaces",
    "/log/*": "TextLog by level: warnings and what was set aside, at the time that they concern",
    "/tf/*": "Transform3D between named frames, over sensor_time: odom, base, camera as recorded",
    "/robot/heading": "Arrows3D in the base frame",
    "/camera": "Pinhole of the snapshot",
    "/camera/depth": "EncodedDepthImage: 16-bit PNG in millimetres, one a snapshot",
    "/camera/colour": "EncodedImage as recorded, one a snapshot; on stage the best one",
    "/camera/edges/*": "Points2D by kind where they were found in the image, one row a snapshot",
    "/camera/candidates": "LineStrips2D in the image: surfaces found; empty once there is a model",
    "/camera/doubts": "LineStrips2D in the image: what the model's doubts are about",
    "/camera/mended": "SegmentationImage, one a snapshot: 1 where a single bad pixel was mended",
    "/camera/model/*": "LineStrips2D in the image: outline, underside, legs; dashed: not measured",
    "/laser/scan": "Points3D in the laser frame: the scan nearest to the snapshot",
    "/trajectory/*": "LineStrips3D of the base: localised, wheels, odometry, registered",
    "/trajectory/cameras": "LineStrips3D: the way through the stops' cameras as registered",
    "/trajectory/correction": "LineStrips3D: the registered way, by how far localisation was off",
    "/calibration/summary": "TextDocument: the camera's corrections",
    "/calibration/floor_before": "Image: the floor's heights over the camera's image, as recorded",
    "/calibration/floor_after": "Image: the same with the depth flattened",
    "/calibration/top_before": "Image: the top's heights over the camera's image, as recorded",
    "/calibration/top_after": "Image: the same with the depth flattened",
    "/segmentation": "AnnotationContext of the labels",
    "/segmentation/summary": "TextDocument: candidate tables and the views' verdicts",
    "/segmentation/labels": "SegmentationImage, one a snapshot",
    "/segmentation/points": "Points3D with class ids, thinned, as localised; grey: not labelled",
    "/segmentation/candidates/*": "LineStrips3D: hulls of the chosen table and of the others",
    "/odometry/summary": "TextDocument",
    "/odometry/scan": "Points3D: scans where odometry put them, thinned in time",
    "/odometry/local_map": "Points3D: KISS-ICP's map at some times of the drive, thinned",
    "/odometry/threshold_mm": "Scalars over sensor_time: the threshold of each scan",
    "/odometry/correction_mm": "Scalars over sensor_time: where a scan ended against its prior",
    "/registration/summary": "TextDocument: pairs with residuals, checks of the stops",
    "/registration/before/*/NN": "Points3D by stop as localised: scan, top, clutter",
    "/registration/after/*/NN": "Points3D by stop as registered: scan, top, clutter",
    "/registration/bases": "Arrows3D on the floor: the base at the stops as registered",
    "/registration/stops": "LineStrips3D: cameras as registered, labelled by number",
    "/registration/localised_stops": "LineStrips3D: cameras as localised",
    "/registration/iterations/*": "Scalars over iteration, a series a pair: fitness, rmse_mm, "
    "inliers",
    "/registration/pairs/summary": "TextDocument: what the entities below show",
    "/registration/pairs/names": "Points3D in the frame pairs: a label a cell",
    "/registration/pairs/*/target": "Points3D in the frame pairs: what was aligned to",
    "/registration/pairs/*/source": "Points3D in a frame of its own: what was aligned",
    "/registration/pairs/*/motion": "Transform3D of that frame over iteration; elsewhere its end",
    "/registration/matrix/*": "Points2D: pairs and stops by residual; at_stop: Boxes2D a snapshot",
    "/registration/graph_in_map/*": "LineStrips3D by kind of pair and whether it was used",
    "/registration/graph_worst": "LineStrips3D: the dropped pairs and the worst ones",
    "/registration/graph_at_stop": "LineStrips3D, one row a snapshot: the pairs of that stop",
    "/registration/pair_at_stop/*": "Points3D, one row a snapshot: target, before and after of the "
    "worst pair of that stop, in the map",
    "/registration/graph_before": "LineStrips3D: the stops before the graph was solved",
    "/registration/correction_mm": "Scalars over snapshot: registered against localised",
    "/outline/summary": "TextDocument: edge points of each kind by view",
    "/outline/edges/*/NN": "Points3D by kind (table, occluded, ...) and view",
    "/outline/top/NN": "Points3D: where a view saw top",
    "/outline/height_mm/*": "Scalars over snapshot: by_view, all_views",
    "/surface/summary": "TextDocument: shapes with weights and dimensions, sides",
    "/surface/crosscheck": "TextDocument: camera against laser",
    "/surface/hull": "LineStrips3D",
    "/surface/beside": "LineStrips3D: what touches the table at its height and was taken off",
    "/surface/candidates": "Clear: of an earlier fit's",
    "/surface/candidates/*": "LineStrips3D by shape",
    "/surface/chosen": "LineStrips3D: sides coloured by status",
    "/surface/residuals": "Points3D: edge points, violet inside to orange outside",
    "/surface/unrolled/*": "2D plot of the residuals along the outline",
    "/surface/residual_histogram_mm": "BarChart",
    "/surface/budget/*": "Boxes2D and Points2D: the parts of each figure's variance, named",
    "/legs/summary": "TextDocument: legs, and what was set aside with reasons",
    "/legs/evidence": "Points3D: scan points near the table",
    "/legs/NN/*": "points: Points3D of a leg; fit: LineStrips3D of its outline",
    "/legs/rejected/*": "Points3D: clusters that are no legs, with reasons",
    "/doubts/*": "LineStrips3D by view: what the model's doubts are about, named by their codes",
    "/model/top": "Mesh3D",
    "/model/legs/NN": "Cylinders3D or Boxes3D",
    "/model/dimensions": "LineStrips3D labelled with name, value and sigma",
    "/model/dimensions/extensions": "LineStrips3D",
    "/model/uncertainty/*": "LineStrips3D: 95 % of place and sides, magnified as the summary says",
    "/tables/NN/name": "Points3D without size: its name in the overview",
    "/tables/NN/**": "summary, outline, surface, legs, model of a table beside the chosen one",
    "/timing/*": "seconds a stage, as text and as a 2D chart",
}


def described() -> str:
    """Return entities and timelines as text, a line each."""
    entities = [f"{path}: {what}" for path, what in ENTITIES.items()]
    timelines = [f"timeline {name}: {what}" for name, what in TIMELINES.items()]
    return "\n".join([*entities, *timelines])
