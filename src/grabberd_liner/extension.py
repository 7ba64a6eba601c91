"""The liner science as an extension of the instrument, by strings alone: finding it costs next to nothing."""

from grabberd.extension import Extension, Place

EXTENSION = Extension(
    name="liner",
    commands=(
        Place("analyse", "grabberd_liner.analyses.command", after="accuracy"),
        Place("study", "grabberd_liner.studies.command", after="analyse"),
        Place("test", "grabberd_liner.guided_tests.command", after="study"),
        Place("render", "grabberd_liner.render.command", after="export"),
    ),
    groups=(Place("profile", "grabberd_liner.profiles.command", after="jobs"),),
    routes=(
        Place("analysis_batches", "grabberd_liner.analyses.routes:batch_router", after="captures"),
        Place("analyses", "grabberd_liner.analyses.routes:router", after="capture_contents"),
        Place("profiles", "grabberd_liner.profiles.routes:router", after="calibrations"),
        Place("studies", "grabberd_liner.studies.routes:router", after="profiles"),
        Place("liner_tests", "grabberd_liner.guided_tests.routes:router", after="studies"),
        Place("pulsation", "grabberd_liner.analyses.routes:pulsation_router", after="devices"),
    ),
    jobs=("grabberd_liner.analyses.job:AnalysisJob", "grabberd_liner.guided_tests.job:LinerTestJob"),
    results=(
        Place("AnalysisResult", "grabberd_liner.analyses.documents:AnalysisResult"),
        Place(
            "LinerTestResult",
            "grabberd_liner.guided_tests.documents:LinerTestResult",
            after="IdentificationResult",
        ),
    ),
    part="grabberd_liner.part:LinerPart",
    columns="grabberd_liner.analyses.capture_analyses:capture_columns",
    schemas=(
        Place("analysis-inputs", "grabberd_liner.schemas:ANALYSIS_INPUTS", after="calibration"),
        Place("profile", "grabberd_liner.schemas:PROFILE", after="analysis-inputs"),
    ),
    library={
        "Analysis": "grabberd_liner.library:Analysis",
        "Capture": "grabberd_liner.library:Capture",
        "open": "grabberd_liner.library:open_capture",
    },
    config_check="grabberd_liner.analyses.capture_analyses:check_inputs",
    fields={
        "CaptureDocument": (
            Place("analysis", "grabberd_liner.analyses.documents:CAPTURE_ANALYSIS", after="channels"),
        ),
        "DeviceDocument": (
            Place(
                "latest_analysis", "grabberd_liner.analyses.documents:LATEST_ANALYSIS", after="field_order"
            ),
            Place(
                "latest_test", "grabberd_liner.guided_tests.documents:LATEST_TEST", after="latest_analysis"
            ),
        ),
    },
    messages="grabberd_liner.messages:DEVICE_TOPICS",
    advice="grabberd_liner.glued_targets:advice",
)
