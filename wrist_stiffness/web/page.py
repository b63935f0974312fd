"""The page: what is opened, where it fails, what is missing, and the models on the way."""

from __future__ import annotations

from nicegui import events, ui

from wrist_stiffness.web.missing_panel import MissingPanel
from wrist_stiffness.web.models_panel import ModelsPanel
from wrist_stiffness.web.open_panel import OpenPanel
from wrist_stiffness.web.tab import Tab
from wrist_stiffness.web.views import Views
from wrist_stiffness.web.workspace import Workspace

STYLE = """
body { background: #f3f4f6; }
.panel { background: white; border: 1px solid #d1d5db; border-radius: 6px; padding: 8px; }
.nicegui-content { padding: 0; gap: 0; }
.q-tab__label { text-transform: none; font-weight: 600; }
.q-btn { text-transform: none; }
.q-btn-toggle { flex: none; }
.q-btn-toggle .q-btn__content { white-space: nowrap; flex-wrap: nowrap; }
.q-expansion-item .q-item { padding: 4px; min-height: 32px; font-weight: 600; }
.q-expansion-item__content .nicegui-expansion-content { padding: 4px; gap: 4px; }
.drop .q-uploader__list { min-height: 48px; padding: 4px; }
@layer overrides {
  *:focus-visible { outline: 3px solid #d55e00 !important; outline-offset: 1px; }
}
"""

FOCUS = """
let last = null;
document.addEventListener("focusin", event => {
  last = event.target.closest("[data-focus]")?.dataset.focus || null;
});
document.addEventListener("pointerdown", () => { last = null; });
new MutationObserver(() => {
  if (last === null || document.activeElement !== document.body) return;
  const again = document.querySelector(`[data-focus="${last}"]`);
  (again || document.querySelector("[aria-current=true]"))?.focus();
}).observe(document.body, {childList: true, subtree: true});
"""
"""What is drawn anew keeps the keyboard's focus; where it is gone, what is chosen takes it."""

LEAVE = """
addEventListener("beforeunload", event => {
  if (document.getElementById("busy").dataset.loses === "true") event.preventDefault();
});
"""
"""Whoever reloads or closes the page is asked first where that loses something."""

START = (
    "Open a recording of your wrist, or an example. The workbench registers the instrument, "
    "calibrates the model and shows where its error remains.",
    "Ask what is missing. Every known effect is ranked by its probability. Click one to see what "
    "it would explain, and what to check on the machine.",
    "Add it. The held-out error, on data that no fit has used, falls towards the noise floor. "
    "Export the model, the report and the commands that do the same.",
)


def build_page(workspace: Workspace, largest: int) -> None:
    """Build the page of one tab; `largest`: of an upload [bytes]."""
    tab = Tab(workspace)
    ui.add_css(STYLE)
    ui.add_body_html(f"<script>{FOCUS}{LEAVE}</script>")
    ui.colors(primary="#0072b2")
    with ui.row().classes("w-full items-center no-wrap px-3 py-1 gap-4 bg-white shadow-1"):
        ui.label("Wrist workbench").classes("text-lg font-bold whitespace-nowrap")
        title = ui.label("nothing opened").classes("text-gray-700 ellipsis")
        ui.space()
        with ui.row().classes("items-center no-wrap gap-2").props("id=busy role=status") as status:
            ui.spinner(size="sm")
            ui.label().classes("whitespace-nowrap").bind_text_from(tab, "words")
            bar = ui.linear_progress(0.0, show_value=False).classes("w-24")
            bar.props("aria-label=progress")
            cancel = ui.button("Cancel", on_click=tab.worker.cancel)
            cancel.props("dense outline color=red")
    status.bind_visibility_from(tab, "busy")

    def progress() -> None:
        bar.set_value(tab.done / tab.total if tab.total else 0.0)
        loses = "true" if tab.busy or tab.unsaved else "false"
        status.props(f"data-calls={tab.calls} data-loses={loses}")

    ui.timer(0.2, progress)
    with ui.row().classes("w-full no-wrap gap-2 p-2 items-stretch"):
        with ui.column().classes("panel gap-1").style("width: 380px; flex: none"):
            with ui.tabs().props("dense align=justify").classes("w-full") as tabs:
                for number, name in enumerate(("Open", "Missing", "Models"), 1):
                    ui.tab(name, f"{number} {name}")
            scroll = "height: calc(100vh - 110px); overflow-y: auto"
            with ui.tab_panels(tabs).classes("w-full").style(scroll).bind_value(tab, "panel"):
                with ui.tab_panel("Open").classes("p-1 gap-2"):
                    OpenPanel(tab, largest)
                with ui.tab_panel("Missing").classes("p-1 gap-2"):
                    MissingPanel(tab)
                with ui.tab_panel("Models").classes("p-1 gap-2"):
                    ModelsPanel(tab)
        with ui.column().classes("grow gap-2").style("min-width: 0") as pictures:
            Views(tab)
        pictures.bind_visibility_from(tab, "rows", backward=bool)
        with ui.column().classes("grow items-center justify-center gap-6 p-8") as start:
            for number, text in enumerate(START, 1):
                with ui.row().classes("no-wrap items-center gap-4").style("max-width: 44rem"):
                    ui.label(str(number)).classes("text-5xl font-bold text-primary")
                    ui.label(text).classes("text-lg")
        start.bind_visibility_from(tab, "rows", backward=lambda rows: not rows)

    def name_it() -> None:
        title.text = f"{', '.join(tab.names)}; model {tab.model_path.stem}"

    def press(event: events.KeyEventArguments) -> None:
        if event.action.keydown and event.key == "Escape" and tab.busy:
            tab.worker.cancel()

    tab.listeners.append(name_it)
    ui.keyboard(on_key=press, ignore=["input", "textarea"])
    ui.context.client.on_delete(tab.worker.end)
