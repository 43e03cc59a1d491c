"""How wrong the prediction of the other cars is: declarations; `verification.foresight` measures it."""

from hj_cosim.metrics.declaration import SUM_OVER_EPISODES, Metric, WeightedMean

PREDICTION_METRICS = (
    *(
        Metric(
            f"prediction_error_{ahead}s",
            label=f"cars predicted {ahead} s ahead are off by",
            unit="m",
            format=".2f",
            better="lower",
            pooling=WeightedMean(f"prediction_samples_{ahead}s"),
            explanation=f"mean distance along the road from where IDM and MOBIL predict a car to where it is {ahead} s"
            " later, of cars within planner.sensing_range, once a second",
            shown="run",
        )
        for ahead in (1, 2, 3)
    ),
    Metric(
        "prediction_lane_3s",
        label="cars in the lane predicted 3 s ahead",
        unit="",
        format=".3f",
        better="higher",
        pooling=WeightedMean("prediction_samples_3s"),
        explanation="share of the cars that are where MOBIL predicts them 3 s later, across the road",
    ),
    *(
        Metric(
            f"prediction_samples_{ahead}s",
            label=f"cars predicted {ahead} s ahead",
            unit="",
            format=".0f",
            better="neither",
            pooling=SUM_OVER_EPISODES,
            explanation="whose prediction was looked up; a car counts once a second",
        )
        for ahead in (1, 2, 3)
    ),
)
