from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib import cbook
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from casysid.report.labels import LONGEST, as_label

NAMES = st.text(st.sampled_from("ab$\\_^{}%# \n\té关"), max_size=40)


@given(NAMES)
@example("$x^$")
@example(r"a\$b$")
def test_names_are_no_formulas_and_stay_short(name):
    label = as_label(name)
    assert not cbook.is_math_text(label)
    shown = label.replace(r"\$", "$")
    assert len(shown) <= LONGEST
    assert "\n" not in shown
    if len(name) <= LONGEST and name.isprintable():
        assert shown == name


def test_a_name_that_is_no_tex_is_drawn():
    canvas = Figure()
    FigureCanvasAgg(canvas)
    ax = canvas.subplots()
    ax.plot([0, 1], label=as_label("$\\no{tex$"))
    ax.set_ylabel(as_label("$x^$"))
    ax.legend()
    canvas.canvas.draw()
