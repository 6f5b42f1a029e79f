"""The figures that the bachelor report published for its ten recordings."""

PUBLISHED: dict[str, dict[str, str]] = {
    "rectangle_extended": {
        "size": "0.843 x 1.22, 89",
        "height": "0.779",
        "scores": ".956 .400",
        "truth": "0.800 x 1.20 x 0.755",
    },
    "rectangle_extended_cluttered": {
        "size": "0.830 x 1.23, 91",
        "height": "0.776",
        "scores": ".990 .416",
        "truth": "0.800 x 1.20 x 0.755",
    },
    "rectangle_default": {
        "size": "0.734 x 1.20, 99",
        "height": "0.755",
        "scores": ".763 .371",
        "truth": "0.800 x 1.20 x 0.755",
    },
    "rectangle_default_cluttered": {
        "size": "0.771 x 1.12, 93",
        "height": "0.758",
        "scores": ".756 .308",
        "truth": "0.800 x 1.20 x 0.755",
    },
    "circle": {
        "size": "d 0.608",
        "height": "0.619",
        "scores": ".867 .900",
        "truth": "d 0.500 x 0.620",
    },
    "circle_cluttered": {
        "size": "d 0.581",
        "height": "0.615",
        "scores": ".891 1.0",
        "truth": "d 0.500 x 0.620",
    },
    "square": {
        "size": "0.606 x 0.607, 87",
        "height": "0.472",
        "scores": "1.0 .627",
        "truth": "0.550 x 0.550 x 0.455",
    },
    "square_cluttered": {
        "size": "0.591 x 0.628, 93",
        "height": "0.473",
        "scores": "1.0 .628",
        "truth": "0.550 x 0.550 x 0.455",
    },
    "desk": {
        "size": "parallelogram",
        "height": "0.736",
        "scores": ".868 .374",
        "truth": "h 0.720, cut-out",
    },
    "desk_cluttered": {
        "size": "parallelogram",
        "height": "0.736",
        "scores": ".805 .345",
        "truth": "h 0.720, cut-out",
    },
}
"""The report's published figures, by scenario (metres, degrees; parallelogram and circle score)."""
