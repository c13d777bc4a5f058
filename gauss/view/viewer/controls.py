"""Controls of what is seen: layers, cameras, light and dark ground."""

from gauss.view.viewer.framing import CAMERAS, placed_camera

LAYERS = {"link": "links", "joint": "joints", "contact": "shapes of contact", "frame": "frames", "path": "paths"}


def add_layers(stages: list, again):
    """Check boxes for links, joints, frames, paths, reactions and contacts; ``again()`` draws the present picture."""
    gui, first = stages[0].server.gui, stages[0]
    with gui.add_folder("show"):
        for role, label in LAYERS.items():
            _toggle(gui, label, [handle for stage in stages for handle in stage.parts[role]])
        arrows = [stage.arrows for stage in stages if stage.arrows is not None]
        _toggle(gui, f"reactions, longest {first.largest:.3g} N", arrows)
        marks = [stage.contacts for stage in stages if stage.contacts.places]
        if marks:
            box = gui.add_checkbox(f"contacts, longest {max(mark.largest for mark in marks):.3g} N", True)

            @box.on_update
            def _(_event):
                for mark in marks:
                    mark.visible = box.value
                again()


def add_view(stage):
    """Buttons of cameras, and a check box for the dark ground."""
    gui = stage.server.gui
    with gui.add_folder("view"):
        cameras = gui.add_button_group("camera", tuple(CAMERAS))
        box = gui.add_checkbox("dark", stage.ground.dark)

    @cameras.on_click
    def _(event):
        if event.client is not None:
            look(event.client, cameras.value)

    @stage.server.on_client_connect
    def _(client):
        if client.camera.aspect < 1.0:
            look(client, "oblique")

    def look(client, camera: str):
        with client.atomic():
            client.camera.position, client.camera.look_at = placed_camera(stage.framing, camera, client.camera.aspect)

    box.on_update(lambda _event: stage.stand_on(box.value))


def _toggle(gui, label: str, handles: list):
    if not handles:
        return
    box = gui.add_checkbox(label, handles[0].visible)

    @box.on_update
    def _(_event):
        for handle in handles:
            handle.visible = box.value
