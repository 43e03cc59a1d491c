import io
from dataclasses import asdict

from rich.console import Console

from hj_cosim.cli.quality import quality_tables
from hj_cosim.verification.guarantee import RolloutSettings, measure_guarantee
from hj_cosim.verification.table_quality import check_table


def test_every_figure_of_a_check_is_shown_under_what_it_means(small_table):
    quality = check_table(small_table, rollouts=50, states=500, seconds=0.5)
    guarantee = measure_guarantee(small_table, RolloutSettings(rollouts=20, duration=1.0))
    found = {
        "table": asdict(quality),
        "filter, game": {**asdict(guarantee), "entered_percent": guarantee.entered_percent},
    }
    console = Console(width=120, record=True, file=io.StringIO())
    for table in quality_tables("small", found):
        console.print(table)
    text = console.export_text()
    assert f"{quality.residual:.2f}" in text
    assert f"{quality.broken_share:.2%}" in text
    assert all(f"unsafe nodes on the face {face}" in text for face in quality.unsafe_on_faces)
    assert all(f"{finer.called_safe_wrongly:.3%}" in text for finer in quality.refinements)
    assert f"{guarantee.entered_percent:.3f}" in text
    assert all(f"entered: {cause}" in text for cause in guarantee.causes)
