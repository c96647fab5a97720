//! A layout as Rerun's blueprint.
//!
//! Rerun's own builders in Rust set neither the eye of a 3D view nor how far back an entity is shown, so the few entities
//! that make up a blueprint are written here; their paths are those of `re_sdk::blueprint`.

use crate::layout::{Eye, Layout, View, ViewKind};
use crate::recording::{EVENT_TIME, Header};
use rerun::RecordingStream;
use rerun::components::Range1D;
use rerun::external::re_log_types::{BlueprintActivationCommand, LogMsg};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EyeControls3D, LineGrid3D, PanelBlueprint, PlotLegend, ScalarAxis, TimeAxis,
    TimePanelBlueprint, ViewBlueprint, ViewContents, ViewportBlueprint, VisibleTimeRanges,
};
use rerun::external::re_sdk_types::blueprint::components::{
    AutoLayout, AutoViews, BackgroundKind, ContainerKind, Corner2D, LoopMode, PanelState, PlayState, RootContainer,
};
use rerun::external::re_sdk_types::datatypes::{
    AbsoluteTimeRange, Bool, TimeRange, TimeRangeBoundary, VisibleTimeRange,
};
use rerun::{ApplicationId, AsComponents, Color, EntityPath, RecordingStreamBuilder, RecordingStreamResult};
use uuid::Uuid;

/// Sends the layout; it is shown as soon as the recording is opened.
pub(crate) fn send(stream: &RecordingStream, application: ApplicationId, header: &Header) -> RecordingStreamResult<()> {
    let (blueprint, storage) = RecordingStreamBuilder::new(application).blueprint().memory()?;
    blueprint.set_time_sequence("blueprint", 0);
    let mut writer = Writer { blueprint: &blueprint, header, named: 0 };
    // The root of a window is a container.
    let root = match &header.layout {
        Layout::View(_) => writer.container(ContainerKind::Tabs, &[(1.0, header.layout.clone())])?,
        Layout::Columns(parts) => writer.container(ContainerKind::Horizontal, parts)?,
        Layout::Rows(parts) => writer.container(ContainerKind::Vertical, parts)?,
        Layout::Tabs(parts) => writer.container(ContainerKind::Tabs, &unweighted(parts))?,
    };
    let viewport = ViewportBlueprint::new()
        .with_root_container(RootContainer(root.into()))
        .with_auto_layout(AutoLayout(Bool(false)))
        .with_auto_views(AutoViews(Bool(false)));
    blueprint.log("viewport", &viewport)?;
    writer.panels()?;

    let messages = storage.take();
    let id = messages.iter().find_map(|message| match message {
        LogMsg::SetStoreInfo(info) => Some(info.info.store_id.clone()),
        _ => None,
    });
    if let Some(blueprint_id) = id {
        let command = BlueprintActivationCommand { blueprint_id, make_active: true, make_default: true };
        stream.send_blueprint(messages, command);
    }
    Ok(())
}

fn unweighted(parts: &[Layout]) -> Vec<(f32, Layout)> {
    parts.iter().map(|part| (1.0, part.clone())).collect()
}

struct Writer<'a> {
    blueprint: &'a RecordingStream,
    header: &'a Header,
    /// Containers and views so far; their names need to be unique within a blueprint only.
    named: u128,
}

impl Writer<'_> {
    /// Writes a part of the window and returns the path of what it became.
    fn part(&mut self, layout: &Layout) -> RecordingStreamResult<String> {
        let id = match layout {
            Layout::View(view) => return self.view(view),
            Layout::Columns(parts) => self.container(ContainerKind::Horizontal, parts)?,
            Layout::Rows(parts) => self.container(ContainerKind::Vertical, parts)?,
            Layout::Tabs(parts) => self.container(ContainerKind::Tabs, &unweighted(parts))?,
        };
        Ok(format!("container/{id}"))
    }

    fn container(&mut self, kind: ContainerKind, parts: &[(f32, Layout)]) -> RecordingStreamResult<Uuid> {
        let id = self.name();
        let contents = parts.iter().map(|(_, part)| self.part(part)).collect::<RecordingStreamResult<Vec<String>>>()?;
        let shares = || parts.iter().map(|(share, _)| *share);
        let mut container = ContainerBlueprint::new(kind).with_contents(contents.iter().map(String::as_str));
        container = match kind {
            ContainerKind::Horizontal => container.with_col_shares(shares()),
            ContainerKind::Vertical => container.with_row_shares(shares()),
            ContainerKind::Tabs | ContainerKind::Grid => container.with_active_tab(contents[0].as_str()),
        };
        self.blueprint.log(format!("container/{id}"), &container)?;
        Ok(id)
    }

    fn view(&mut self, view: &View) -> RecordingStreamResult<String> {
        let id = self.name();
        let path = format!("view/{id}");
        let class = match view.kind {
            ViewKind::Scene(_) => "3D",
            ViewKind::Picture => "2D",
            ViewKind::Signals { .. } => "TimeSeries",
            ViewKind::States => "StateTimeline",
            ViewKind::Log => "TextLog",
            ViewKind::Document => "TextDocument",
        };
        // A picture is seen from its own entity, a scene that follows something from that: so it stays in the middle.
        let origin = match &view.kind {
            ViewKind::Picture => view.contents[0].as_str(),
            ViewKind::Scene(Eye { follows: Some(entity), .. }) => entity.as_str(),
            _ => "/",
        };
        let blueprint = ViewBlueprint::new(class).with_display_name(view.name.as_str()).with_space_origin(origin);
        self.blueprint.log(path.as_str(), &blueprint)?;
        let query = view.contents.iter().map(|entity| match entity.strip_prefix('-') {
            Some(entity) => format!("- /{entity}"),
            None => format!("+ /{entity}"),
        });
        self.blueprint.log(format!("{path}/ViewContents"), &ViewContents::new(query))?;
        self.properties(&path, &view.kind)?;
        for entity in &view.trails {
            let entity = EntityPath::parse_forgiving(entity);
            let overrides = ViewContents::blueprint_base_visualizer_path_for_entity(id, &entity);
            self.blueprint.log(overrides, &everything_up_to_now())?;
        }
        Ok(path)
    }

    fn properties(&self, path: &str, kind: &ViewKind) -> RecordingStreamResult<()> {
        let set = |property: &str, value: &dyn AsComponents| self.blueprint.log(format!("{path}/{property}"), value);
        match kind {
            ViewKind::Scene(eye) => {
                set("EyeControls3D", &eye_controls(eye))?;
                set("LineGrid3D", &LineGrid3D::new().with_visible(false))?;
                set("Background", &Background::new(BackgroundKind::SolidColor).with_color(Color::from_rgb(24, 26, 30)))
            }
            ViewKind::Signals { range } => {
                if let Some([low, high]) = *range {
                    set("ScalarAxis", &ScalarAxis::new().with_range(Range1D::new(low, high)))?;
                }
                // All of it, while the cursor runs through: otherwise a plot follows the cursor and starts empty.
                let whole = TimeRange { start: TimeRangeBoundary::Infinite, end: TimeRangeBoundary::Infinite };
                set("TimeAxis", &TimeAxis::new().with_view_range(whole))?;
                set("PlotLegend", &PlotLegend::new().with_corner(Corner2D::LeftTop))
            }
            ViewKind::Picture | ViewKind::States | ViewKind::Log | ViewKind::Document => Ok(()),
        }
    }

    fn panels(&self) -> RecordingStreamResult<()> {
        let collapsed = || PanelBlueprint::new().with_state(PanelState::Collapsed);
        self.blueprint.log("blueprint_panel", &collapsed())?;
        self.blueprint.log("selection_panel", &collapsed())?;
        let mut time = TimePanelBlueprint::new()
            .with_state(PanelState::Collapsed)
            .with_timeline(self.header.timeline)
            .with_play_state(PlayState::Playing);
        if let Some(moment) = self.header.event {
            let [min, max] = moment.played_s.map(|seconds| ((seconds * 1e9) as i64).into());
            time = time.with_time_selection(AbsoluteTimeRange { min, max }).with_loop_mode(LoopMode::Selection);
        }
        self.blueprint.log("time_panel", &time)
    }

    fn name(&mut self) -> Uuid {
        self.named += 1;
        Uuid::from_u128(self.named)
    }
}

fn eye_controls(eye: &Eye) -> EyeControls3D {
    EyeControls3D::new().with_position(eye.position).with_look_target(eye.target).with_eye_up(eye.up)
}

/// Everything from the beginning to the cursor, not the latest only.
fn everything_up_to_now() -> VisibleTimeRanges {
    let range =
        || TimeRange { start: TimeRangeBoundary::Infinite, end: TimeRangeBoundary::CursorRelative(0_i64.into()) };
    let timelines = ["sim_time", "tick", EVENT_TIME];
    VisibleTimeRanges::new(timelines.map(|timeline| VisibleTimeRange { timeline: timeline.into(), range: range() }))
}
