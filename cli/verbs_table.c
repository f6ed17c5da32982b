/* What the program can do. */
#include <stdint.h>
#include <string.h>

#include "apsm/options.h"
#include "verbs.h"

static const cli_verb_info verbs[] = {
    { CLI_RUN, "run", "INPUT... -o MODEL_DIR",
      "the whole job: groom, initialize, optimize, evaluate, report",
      "Makes a shape model of the inputs: segmentations (NRRD, NIfTI, MetaImage, .mgz, TIFF, DICOM "
      "folders), meshes (PLY, STL, OBJ, OFF, VTK, VTP, GIFTI, FreeSurfer's), contours (VTK, VTP), "
      "folders of them, or a project (.swproj, .xlsx). An interrupted run continues with --resume, "
      "and every step can be repeated on its own.",
      .examples = "  apsm run shapes/ -o model --reflect-match '_left'\n"
                  "  apsm run masks/ -o model --label 1,2 -J 256\n"
                  "  apsm run ankles/ -o joint --parts tibia=_tibia,talus=_talus\n"
                  "  apsm run --resume -o model\n",
      .out = "a model folder", .call = apsm_cli_run },
    { CLI_GROOM, "groom", "INPUT... -o MODEL_DIR", "from inputs to clean, aligned meshes",
      "Reads the inputs, makes one closed mesh of each, chooses the template and aligns all shapes "
      "to it. Without INPUT the inputs named in the project of the folder are groomed again.",
      .examples = "  apsm groom masks/ -o model --label 1\n", .out = "a model folder",
      .call = apsm_cli_groom },
    { CLI_INITIALIZE, "initialize", "MODEL_DIR", "the first particles, on groomed meshes",
      "Places the first particles on every groomed mesh.",
      .examples = "  apsm initialize model -J 256\n", .out = "a model folder",
      .call = apsm_cli_initialize },
    { CLI_OPTIMIZE, "optimize", "MODEL_DIR", "from first particles to correspondence",
      "Moves the particles until they correspond, in two stages. With --resume it starts from the "
      "last checkpoint, otherwise from the first particles.",
      .examples = "  apsm optimize model\n", .out = "a model folder", .call = apsm_cli_optimize },
    { CLI_EVALUATE, "evaluate", "MODEL_DIR|PROJECT|PARTICLES... [MESHES...]",
      "the model, its quality, reconstructed meshes",
      "Computes mean and modes of variation, scores, surface distances, compactness, "
      "generalization, specificity and the certificate of correspondence, and writes meshes. Given "
      "particle files of any program (aligned; line j is the same place everywhere) or a project "
      "(.swproj, .xlsx), it prints the figures and writes nothing; meshes in the same order and "
      "frame, or those of the project, add surface distances.",
      .examples = "  apsm evaluate model\n"
                  "  apsm evaluate other.swproj\n",
      .call = apsm_cli_evaluate },
    { CLI_CERTIFY, "certify", "PROJECT|PARTICLES... MESHES...", "the verdict on anyone's particles",
      "Says of every shape whether its particles keep their neighbours, whether it lies as the "
      "others do and is not a mirror image, whether it belongs and all parts of its surface do, "
      "and whether a region has slipped or an end was missed: the verdict that evaluate gives, for "
      "a project with its meshes, or for particle files of any program (aligned) with one mesh "
      "each, in the same order and frame.",
      .examples = "  apsm certify other.swproj\n"
                  "  apsm certify *_world.particles *.ply -o verdict.json\n",
      .first = "something to look at", .call = apsm_cli_certify },
    { CLI_REPORT, "report", "MODEL_DIR|FITS_DIR", "the model as one page for the browser",
      "Writes MODEL_DIR/report.html from the results in the folder: mean and modes to play with, "
      "the cohort, surface distances, quality of the model, the certificate, and where everything "
      "comes from. For a folder of fit: the new shapes beside the mean. The page is one file that "
      "needs no network: double-click it, or send it by mail.",
      .examples = "  apsm report model\n", .out = "a model folder", .call = apsm_cli_report },
    { CLI_RENDER, "render", "MODEL_DIR", "pictures of the model as PNG files",
      "Draws the mean, the first modes at two standard deviations, a shape with its particles, and "
      "all shapes on one sheet, without a window system or a browser.",
      .examples = "  apsm render model\n"
                  "  apsm render model --what modes -o modes.png --width 1600\n",
      .first = "one model folder", .most = 1, .call = apsm_cli_render },
    { CLI_FIT, "fit", "MODEL INPUT... -o DIR", "new shapes by a finished model",
      "Fits shapes that the model has not seen: finds their pose and side, places the model's "
      "particles on them, and tells their scores, their distance from the mean, and whether each "
      "is a shape of the model's kind. One that is not is refused, with the reason. Parts of "
      "shapes, clouds of points and landmarks can be fitted, too. MODEL is a model folder or a "
      "file of export; it is not changed. The exit code is 1 if a shape was refused or could not "
      "be read.",
      .examples = "  apsm fit model new/ -o fits\n"
                  "  apsm fit model patient.nii.gz -o fits --label 1\n"
                  "  apsm fit model points.mrk.json -o fits --landmarks on_mean.mrk.json\n",
      .first = "a model", .more = "shapes behind the model", .out = "an output folder",
      .call = apsm_cli_fit },
    { CLI_TEST, "test", "MODEL_DIR --formula TEXT [--subjects FILE]",
      "do groups differ, where, and by how much",
      "Tests a term of a linear model of the shapes by permutation, with the other terms allowed "
      "for: all particles together, each particle by itself with and without correction for their "
      "number, the size, or the modes. Tells effects with 95 % bands, how well shape separates two "
      "groups, and what could have been found. Writes OF_ON.json and OF_ON.csv, and adds a page to "
      "the report.",
      .examples = "  apsm test model --subjects table.csv --formula '~ group + age'\n"
                  "  apsm test model --subjects table.csv --formula '~ group' --on shape\n",
      .first = "one model folder", .most = 1, .call = apsm_cli_test },
    { CLI_ASYMMETRY, "asymmetry", "MODEL_DIR --of SIDE --within SUBJECT",
      "do left and right differ, always or by chance",
      "Compares left and right of the same subjects (mirrored: run --reflect-match) by Procrustes "
      "analysis of variance: directional asymmetry, the same in all subjects, by exchanging the "
      "sides within subjects; and, if sides were measured repeatedly, fluctuating asymmetry beyond "
      "the error of measurement. Writes asymmetry_ON.json, asymmetry_ON_subjects.csv with every "
      "subject's amount, as columns for test, and both tests.",
      .examples = "  apsm asymmetry model --subjects table.csv --of side --within person\n",
      .first = "one model folder", .most = 1, .call = apsm_cli_asymmetry },
    { CLI_MEASURE, "measure", "MODEL_DIR DEFINITION.json [PARTICLES|FIT...]",
      "distances, angles, diameters, areas of every shape",
      "Evaluates what DEFINITION.json defines once on the template (distance, angle, "
      "plane-distance, sphere, cylinder, section, thickness, area, volume) on every shape of the "
      "model, on the mean, on its modes at two standard deviations, and on shapes that were "
      "fitted. Writes measurements.json and measurements.csv; test takes the table as --subjects.",
      .examples = "  apsm measure model definition.json\n"
                  "  apsm measure model definition.json fits\n",
      .first = "a model folder and a definition", .more = "a model folder and a definition",
      .call = apsm_cli_measure },
    { CLI_LANDMARKS_VERB, "landmarks", "MODEL_DIR POINTS -o DIR",
      "points placed once, on every shape",
      "Carries named points (.mrk.json, .fcsv or .csv with name,x,y,z) that were placed on the "
      "template, in the frame of its input file, to every shape of the model in the frame of its "
      "own file, and to the mean and its modes at two standard deviations. Writes NAME.mrk.json "
      "for each, and landmarks.csv for all shapes, which run takes as --landmarks.",
      .examples = "  apsm landmarks model points.mrk.json -o marks\n",
      .first = "a model folder and a file of points", .more = "a model folder and a file of points",
      .most = 2, .out = "an output folder", .call = apsm_cli_landmarks },
    { CLI_NORM, "norm", "MODEL_DIR PARTICLES|FIT...",
      "how unusual a new shape is, given age, sex or whatever is known",
      "Compares shapes that were fitted (their world particles, or a folder of fit) with those of "
      "the model: percentile and z of the whole shape, of every mode and of every particle, after "
      "what the formula allows for, with how certain that is; also of sizes and of columns of the "
      "table. Writes norm.json, norm.csv, NAME_norm.csv and norm.html, a page to look at.",
      .examples = "  apsm norm model fits --subjects table.csv --formula '~ age + sex'\n",
      .first = "a model folder and shapes", .more = "a model folder and shapes",
      .call = apsm_cli_norm },
    { CLI_PREDICT, "predict", "MODEL_DIR --of COLUMN [PARTICLES|FIT...]",
      "a column from the shape: age, a measurement, one of two groups",
      "Learns a column of the table of subjects from the shape (ridge regression on the particles) "
      "and tells how well that works, by cross-validation with every step inside the folds; tells "
      "the value for new shapes that were fitted, with a 95 % interval; and with --at the shape to "
      "be expected for given values. Writes COLUMN_prediction.json and COLUMN_prediction.csv.",
      .examples = "  apsm predict model --of age --subjects table.csv fits\n"
                  "  apsm predict model --of age --subjects table.csv --at 30,80\n",
      .first = "a model folder", .call = apsm_cli_predict },
    { CLI_EXCLUDE, "exclude", "MODEL_DIR NAME...", "a model without some of its shapes",
      "Takes shapes out of a finished model: mean, modes, figures and report are made anew, "
      "nothing is groomed or optimised again, and the files of these shapes are removed from the "
      "folder.",
      .examples = "  apsm exclude model patient_07 patient_12\n",
      .first = "a model folder and names of its shapes",
      .more = "a model folder and names of its shapes", .call = apsm_cli_exclude },
    { CLI_ADD, "add", "MODEL_DIR INPUT...", "new shapes into a finished model",
      "Fits shapes to a finished model and enrols them; the particles of the others stay as they "
      "are. Labels and sides are read as for the model's own shapes, unless --label or "
      "--reflect-match say otherwise for the new files; everything else is as the model was made. "
      "If one shape is refused, none is added.",
      .examples = "  apsm add model more/\n", .first = "a model folder and shapes",
      .more = "a model folder and shapes", .call = apsm_cli_add },
    { CLI_COMPARE, "compare", "MODEL_A MODEL_B", "the same anatomy in two models",
      "Lays the second model (a folder, or a file of export) on the first and tells how far apart "
      "their mean surfaces are, how alike their variation is (angles between the leading modes, "
      "share of the variance of one that the other has), and which of them better rebuilds shapes "
      "that both have, each left out in turn.",
      .examples = "  apsm compare model other -o differences\n", .first = "two models",
      .more = "two models", .most = 2, .call = apsm_cli_compare },
    { CLI_IMPORT, "import", "PROJECT|MODEL.h5|PARTICLES... [MESHES...] -o DIR",
      "a model from anyone's particles or model",
      "Makes a model folder of particles that another program has placed: a project with particles "
      "and groomed meshes (.swproj, .xlsx), or particle files (aligned) and one mesh each, in the "
      "same order and frame; or of a model file of Scalismo or Statismo (.h5, .h5.json): its "
      "shapes, or, if it keeps none, shapes that have its mean and covariance, with vertices far "
      "from each other as particles. Nothing is groomed or optimised; the model is evaluated, "
      "certified and reported like one of apsm's own, and fit, test, export and the other verbs "
      "take it.",
      .examples = "  apsm import other.swproj -o model\n"
                  "  apsm import model.h5 -o model\n",
      .first = "a project, or particles", .out = "a model folder", .call = apsm_cli_import },
    { CLI_WARP, "warp", "MODEL_DIR|MESH PARTICLES... -o DIR", "from particles to meshes",
      "Warps a mesh to particle sets, whoever made them: the template of a model folder, or else "
      "MESH, on which the first particle set lies. Each of the others (or a project, or a .npy of "
      "several) gives DIR/NAME.ply. With --attach, landmarks and meshes are carried along, and "
      "elements of tetrahedral meshes that turn inside out are named.",
      .examples = "  apsm warp model new_world.particles -o meshes\n"
                  "  apsm warp model *_world.particles -o meshes --attach volume.vtk\n",
      .first = "a model folder or a mesh", .more = "particles", .out = "an output folder",
      .call = apsm_cli_warp },
    { CLI_EXPORT, "export", "MODEL_DIR --to FORMAT -o OUT|--model FILE",
      "a model for other programs, or as one file",
      "With --to: the model on the vertices of the template's mesh, for other programs. vtp, ply, "
      "stl, obj: a folder of meshes (the mean, its modes and every shape); gltf: a .glb file whose "
      "morph targets are the modes; scalismo, statismo: an HDF5 file (.h5); monai: "
      "pca_mean_surface.vtp and pca_model.json; slicermorph: the folder of its GPA; csv, npz: "
      "tables and arrays. With --model: all that fit needs in one file, which holds no names of "
      "shapes and works where the cohort is not.",
      .examples = "  apsm export model --to gltf -o model.glb\n"
                  "  apsm export model --to scalismo -o model.h5\n"
                  "  apsm export model --model talus.apsm\n",
      .first = "one model folder", .most = 1, .call = apsm_cli_export },
    { CLI_CHECK, "check", "INPUT...|MODEL_DIR", "what is wrong with inputs or a project",
      "Reads everything and reports every problem in one line; writes nothing. The exit code is 0 "
      "if there is none.",
      .examples = "  apsm check shapes/\n"
                  "  apsm check project.swproj\n",
      .first = "something to look at", .call = apsm_cli_check },
    { CLI_CONVERT, "convert", "INPUT... -o OUTPUT", "particles to and from other programs' files",
      "Rewrites particle sets. An input is a file (.particles, .lpts, .wpts, .csv, .npy, .mrk.json "
      "of 3D Slicer, points as .vtk or .vtp), or a model folder or project, which stands for the "
      "world particles of its shapes. OUTPUT is a file of one of these formats; only .npy holds "
      "several shapes, as one array of shapes x particles x 3. With --to EXT it is a folder with "
      "one file per shape. Order and frame of the particles are kept. A project or model folder is "
      "rewritten as a project if OUTPUT ends in .swproj or .xlsx.",
      .examples = "  apsm convert model -o particles.npy\n"
                  "  apsm convert model -o markups --to mrk.json\n"
                  "  apsm convert model -o project.xlsx\n",
      .first = "particles", .out = "an output", .call = apsm_cli_convert },
    { CLI_VERIFY, "verify", "MODEL_DIR", "whether a model folder still is what was made",
      "Computes the SHA-256 of every file of a model folder and of its inputs and compares it with "
      "manifest.json; compares the options of the manifest, the project and the checkpoints. Tells "
      "in one line each what has changed, is missing or does not belong. Writes nothing. The exit "
      "code is 0 if all agree and 1 if not.",
      .examples = "  apsm verify model\n", .out = "a model folder", .call = apsm_cli_verify },
    { CLI_INFO, "info", "MODEL_DIR|FILE", "what a model folder or file holds",
      "Tells in a few lines what a model folder or one of its files holds: of a model its verdict, "
      "surface distance, variance and version.",
      .examples = "  apsm info model\n"
                  "  apsm info model/state/optimize.ckpt\n",
      .first = "something to look at", .most = 1, .call = apsm_cli_info },
};
enum { VERBS = sizeof verbs / sizeof *verbs };

const cli_verb_info *cli_verbs(size_t *n)
{
    *n = VERBS;
    return verbs;
}

const cli_verb_info *cli_find_verb(const char *name)
{
    for (size_t i = 0; i < VERBS; i++)
        if (strcmp(verbs[i].name, name) == 0) return &verbs[i];
    return NULL;
}

const char *cli_verb_hint(const char *word)
{
    static const char *const hints[][2] = {
        { "analyze", "evaluate makes model and figures, report shows them, test compares groups" },
        { "analyse", "evaluate makes model and figures, report shows them, test compares groups" },
        { "view", "report makes a page to look at, render makes pictures" },
        { "show", "report makes a page to look at, render makes pictures" },
        { "studio", "report makes a page to look at, render makes pictures" },
        { "resume", "go on with run --resume -o MODEL_DIR" },
        { "version", "apsm --version tells it" }
    };
    for (size_t k = 0; k < sizeof hints / sizeof *hints; k++)
        if (strcmp(hints[k][0], word) == 0) return hints[k][1];
    return NULL;
}

const char *cli_nearest_verb(const char *word)
{
    size_t best = 0, least = SIZE_MAX;
    for (size_t i = 0; i < VERBS; i++) {
        const size_t d = apsm_edit_distance(word, verbs[i].name);
        if (d < least) least = d, best = i;
    }
    return verbs[best].name;
}
