/* names.h -- what a model folder holds, and the versions of its files: said here alone.
 * docs/formats.md describes each. */
#ifndef APSM_FOLDER_NAMES_H
#define APSM_FOLDER_NAMES_H

#define FOLDER_PROJECT        "project.swproj"
#define FOLDER_MANIFEST       "manifest.json"
#define FOLDER_MODEL          "model.json"
#define FOLDER_SCORES_CSV     "scores.csv"
#define FOLDER_EVALUATION     "evaluation.json"
#define FOLDER_EVALUATION_CSV "evaluation.csv"
#define FOLDER_CERTIFICATE    "certificate.json"
#define FOLDER_CALIBRATION    "calibration.json"
#define FOLDER_LANDMARKS      "landmarks.csv"
#define FOLDER_FEATURES       "features.csv"
#define FOLDER_HISTORY        "history.csv"
#define FOLDER_POSE_SHAPE     "pose_shape.json" /* of a joint */
#define FOLDER_JOINT_FITS     "joint_fit.json"  /* of fits to a joint */
#define FOLDER_REPORT         "report.html"
#define FOLDER_INITIAL        "state/initial.ckpt"
#define FOLDER_CHECKPOINT     "state/optimize.ckpt"
#define FOLDER_JOURNAL        "state/work.journal"

/* "format" and "version" of the JSON files: what is written, and the newest that is read. */
#define FORMAT_MODEL       "apsm-model"
#define FORMAT_EVALUATION  "apsm-evaluation"
#define FORMAT_CERTIFICATE "apsm-certificate"
#define FORMAT_CALIBRATION "apsm-calibration"
#define FORMAT_MANIFEST    "apsm-manifest"
enum {
    MODEL_VERSION = 1,
    EVALUATION_VERSION = 1,
    CERTIFICATE_VERSION = 1,
    CALIBRATION_VERSION = 1,
    MANIFEST_VERSION = 1
};

#endif
