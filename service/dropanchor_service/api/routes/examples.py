"""One example of each response, for the OpenAPI document."""

from typing import Any

_ELLIPSE = {"semi_major_m": 0.24, "semi_minor_m": 0.15, "angle_rad": 1.2}
_PARTS = {"north_m": 0.06, "mount_m": 0.03, "speed_m": 0.02, "bearing_m": 0.076, "ranges_m": 0.05, "height_m": 0.01}

POSE: dict[str, Any] = {
    "tag": "tag-1",
    "t_ns": 1_800_000_000_000_000_000,
    "age_s": 0.042,
    "state": "tracking",
    "reason": "resolved",
    "hint": "",
    "frame": "site",
    "relative_pose": None,
    "x": 3.2,
    "y": -1.7,
    "z": 1.1,
    "z_std_m": 0.15,
    "z_source": "told",
    "floor": None,
    "floor_probability": None,
    "heading_rad": 0.61,
    "speed_mps": 1.1,
    "yaw_rate_radps": 0.02,
    "covariance": [[0.0045, 0.0016, 0.0], [0.0016, 0.0087, 0.0], [0.0, 0.0, 0.001]],
    "ellipse_95": _ELLIPSE,
    "p_mode": 0.998,
    "sigma_pos_m": 0.115,
    "sigma_parts": _PARTS,
    "sigma_obs_m": 0.31,
    "range_m": 3.64,
    "anchor": "1",
    "hypotheses": [],
    "lat": 52.512345678,
    "lon": 13.412345678,
    "alt_m": None,
    "online": True,
    "epoch": 0,
}
EXPLANATION: dict[str, Any] = {
    "pose": POSE,
    "hypotheses": [],
    "speed": {"speed_mps": 1.1, "range_rate_mps": 0.82, "predicted_range_rate_mps": 0.79},
    "speed_track": {"t_ns": [1_799_999_999_750_000_000, 1_800_000_000_000_000_000], "speed_mps": [1.08, 1.1]},
    "height_track": {
        "t_ns": [1_799_999_999_750_000_000, 1_800_000_000_000_000_000],
        "z": [1.1, 1.1],
        "z_std_m": [0.15, 0.15],
    },
    "uncertainty": {
        "half_m": 0.24,
        "largest": "bearing",
        "largest_m": 0.16,
        "text": "± 0.2 m, of which 0.2 m come from the direction in which it started. A second anchor would tell.",
        "phrase": {
            "code": "uncertainty",
            "values": {
                "half": "0.2",
                "part": "0.2",
                "cause": "the direction in which it started",
                "cause.code": "uncertain.bearing",
                "cure": "A second anchor would tell.",
                "cure.code": "cure.anchor",
            },
        },
    },
    "north": {"error_rad": -0.61, "std_rad": 0.11},
    "innovations": [
        {
            "t_ns": 1_800_000_000_000_000_000,
            "kind": "range",
            "anchor": "1",
            "measured": 3.64,
            "predicted": 3.58,
            "innovation": 0.06,
            "variance": 0.0144,
            "nis": 0.25,
            "p_outlier": 0.02,
            "fused": True,
        }
    ],
    "refused": 0,
    "samples": {"imu": 60000, "range": 6000},
    "rejected": {"range_negative": 2},
}
POSE_LIST: dict[str, Any] = {"t_ns": 1_800_000_000_042_000_000, "poses": [POSE]}
POSE_FRAME: dict[str, Any] = {
    "t_ns": 1_800_000_000_042_000_000,
    "epoch": 0,
    "tags": ["tag-1", "tag-2"],
    "online": [True, True],
    "state": ["tracking", "initialising"],
    "reason": ["resolved", "no_heading"],
    "hint": [
        "",
        "There is no heading yet: the tag must send IMU samples or a platform heading, or range to three anchors.",
    ],
    "frame": ["site", "site"],
    "relative_pose": [None, None],
    "anchor": ["1", "1"],
    "age_s": [0.042, 0.05],
    "x": [3.2, None],
    "y": [-1.7, None],
    "z": [1.1, None],
    "z_std_m": [0.15, None],
    "z_source": ["told", None],
    "floor": [None, None],
    "floor_probability": [None, None],
    "heading_rad": [0.61, None],
    "speed_mps": [1.1, None],
    "yaw_rate_radps": [0.02, None],
    "range_m": [3.64, 7.1],
    "p_mode": [0.998, None],
    "sigma_pos_m": [0.115, None],
    "sigma_obs_m": [0.31, None],
    "semi_major_m": [0.24, None],
    "semi_minor_m": [0.15, None],
    "angle_rad": [1.2, None],
    "hypotheses": [None, None],
}
TAG_SETTINGS: dict[str, Any] = {
    "name": "Forklift 1",
    "colour": "#0b62b8",
    "group": "forklifts",
    "height_m": 1.1,
    "height_motion": "auto",
    "range_std_m": 0.1,
    "range_bias_m": 0.0,
    "range_bias_std_m": None,
    "range_scale": 1.0,
    "mount_angle_rad": 0.0,
    "mount_angle_std_rad": None,
    "lever_forward_m": 0.3,
    "lever_left_m": 0.0,
    "slip_std_rad": None,
    "speed_max_mps": None,
    "reverse_allowed": False,
    "heading_source": "auto",
    "heading_std_rad": None,
    "magnetometer_calibrated": False,
    "motion": "auto",
    "start": {"x": 2.0, "y": 0.5, "heading_rad": None, "std_m": 0.1},
}
HEALTH: dict[str, Any] = {"battery_fraction": 0.15, "temperature_c": 24.5, "firmware": "1.4.2", "rssi_dbm": -61.0}
REMOTE_SETTINGS: dict[str, Any] = {
    "wanted": {"batch_s": 0.5, "imu_hz": 50.0},
    "acknowledged": {"batch_s": 0.5, "imu_hz": 50.0},
}
TAG: dict[str, Any] = {
    "tag": "tag-1",
    "online": True,
    "first_heard_ns": 1_799_999_400_000_000_000,
    "last_heard_ns": 1_800_000_000_000_000_000,
    "messages": 3000,
    "samples": {"imu": 60000, "range": 6000},
    "rejected": {"range_negative": 2},
    "hint": "",
    "unknown_anchor": None,
    "health": HEALTH | {"age_s": 12.5},
    "clock_offset": {
        "offset_s": 0.02,
        "uncertainty_s": 0.1,
        "from_motion": {"offset_s": -0.05, "uncertainty_s": 0.25},
        "corrected": False,
    },
    "clock_error_s": None,
    "needs_care": [{"reason": "battery_low", "hint": "The battery is at 15%: charge it."}],
    "remote_settings": REMOTE_SETTINGS,
    "settings": TAG_SETTINGS,
}
TAG_LIST: dict[str, Any] = {"t_ns": 1_800_000_000_042_000_000, "tags": [TAG]}
PENDING_TAG_LIST: dict[str, Any] = {
    "t_ns": 1_800_000_000_042_000_000,
    "tags": [
        {
            "tag": "tag-7",
            "first_heard_ns": 1_800_000_000_000_000_000,
            "last_heard_ns": 1_800_000_000_040_000_000,
            "messages": 3,
        }
    ],
}
NEWCOMER_LIST: dict[str, Any] = {"t_ns": PENDING_TAG_LIST["t_ns"], "newcomers": PENDING_TAG_LIST["tags"]}
ANCHOR: dict[str, Any] = {"id": "1", "x": 0.0, "y": 0.0, "z": 2.5}
SITE: dict[str, Any] = {
    "id": "default",
    "name": "Yard",
    "declination_rad": 0.07,
    "declination_std_rad": None,
    "georeference": {"lat": 52.5123, "lon": 13.4123, "rotation_rad": 0.0},
    "anchors": [ANCHOR],
}
SITE_LIST: dict[str, Any] = {
    "sites": [
        {
            "site": "default",
            "name": "Yard",
            "georeference": SITE["georeference"],
            "anchors": 1,
            "tags": 10,
            "online": 9,
            "states": {"tracking": 8, "coasting": 1},
            "needs_care": 1,
        }
    ]
}
TRACK: dict[str, Any] = {
    "tag": "tag-1",
    "from_ns": 1_799_996_400_000_000_000,
    "to_ns": 1_800_000_000_000_000_000,
    "poses": [
        {
            name: (POSE | {"t_utc": "2027-01-15T08:00:00.000000000Z"})[name]
            for name in (
                *(
                    "t_ns",
                    "t_utc",
                    "state",
                    "reason",
                    "frame",
                    "relative_pose",
                    "x",
                    "y",
                    "z",
                    "z_std_m",
                    "z_source",
                    "floor",
                    "floor_probability",
                    "heading_rad",
                    "speed_mps",
                    "yaw_rate_radps",
                    "p_mode",
                ),
                *("sigma_pos_m", "sigma_obs_m", "range_m", "covariance", "anchor", "lat", "lon", "alt_m", "epoch"),
            )
        }
    ],
    "next": None,
}
TRACKS: dict[str, Any] = {
    "from_ns": 1_799_996_400_000_000_000,
    "to_ns": 1_800_000_000_000_000_000,
    "tracks": [
        {
            "tag": "tag-1",
            "poses": 3480,
            "tracked_s": 3475.0,
            "distance_m": 1240.5,
            "mean_speed_mps": 0.357,
            "max_speed_mps": 1.92,
            "points": {
                "t_ns": [1_799_996_400_000_000_000, 1_800_000_000_000_000_000],
                "state": ["tracking", "tracking"],
                "frame": ["site", "site"],
                "relative_pose": [None, None],
                "x": [3.25, 4.5],
                "y": [-1.5, 2.0],
                "z": [1.1, 1.1],
                "z_std_m": [0.15, 0.15],
                "z_source": ["told", "told"],
                "floor": [None, None],
                "floor_probability": [None, None],
                "heading_rad": [1.57, 0.0],
                "speed_mps": [1.1, 0.0],
                "sigma_pos_m": [0.2, 0.17],
                "semi_major_m": [0.5, 0.4],
                "semi_minor_m": [0.2, 0.2],
                "angle_rad": [0.0, 0.0],
                "since_previous": ["unknown", "tracking"],
                "off_m": [0.0, 0.04],
            },
        }
    ],
}
CONNECT: dict[str, Any] = {
    "endpoints": ["tcp/192.168.1.10:7447"],
    "credentials": False,
    "simulate": "dropanchor-tag simulate --connect tcp/192.168.1.10:7447",
    "pages": ["http://192.168.1.10:8080/"],
    "may_simulate": True,
}
NO_RECORDING: dict[str, Any] = {"recording": False, "since_ns": None, "tags": None, "file": None}
RECORDING: dict[str, Any] = {"recording": True, "since_ns": 1_800_000_000_000_000_000, "tags": None, "file": None}
RECORDINGS: dict[str, Any] = NO_RECORDING | {
    "files": [
        {
            "name": "yard-20270115T080000-000000Z.mcap",
            "bytes": 1_048_576,
            "changed_ns": 1_800_000_060_000_000_000,
            "finished": True,
        }
    ]
}
SAMPLES: dict[str, Any] = {"range": [{"t_ns": 1_800_000_000_000_000_000, "anchor": "1", "range_m": 12.34}]}
PHONE_READINGS: dict[str, Any] = {"samples": 100, "unpaired": 0, "damaged": 0, "duplicate": False, "waiting": 0}
