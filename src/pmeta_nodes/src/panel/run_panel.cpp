#include "panel/run_panel.h"

#include <rviz/view_controller.h>
#include <rviz/view_manager.h>
#include <rviz/visualization_manager.h>
#include <rviz/window_manager_interface.h>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QLabel>
#include <QMainWindow>
#include <QProgressBar>
#include <QPushButton>
#include <QResizeEvent>
#include <QScreen>
#include <QTableWidget>
#include <QVBoxLayout>
#include <QWindow>
#include <pluginlib/class_list_macros.hpp>

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/format.h"
#include "pmeta_nodes/scene.h"

namespace pmeta_nodes {
namespace {

constexpr int kWidth = 400;           // px, to begin with
constexpr int kRefreshAfter = 100;    // ms
constexpr int kClockInterval = 1000;  // ms

const char* const kFlatView = "rviz/TopDownOrtho";
constexpr double kMargin = 0.3;  // around the scene, in its units

// as in the scene
const char* const kPersonalStyle = "color: #d81b60; font-weight: bold";
const char* const kMetaStyle = "color: #0b4fb3; font-weight: bold";
const char* const kFaintStyle = "color: #666666";
const char* const kWarningStyle = "color: #b3261e";

enum Column { kTask, kPersonal, kMeta, kAgent, kSpeed, kColumns };

// settings files of rviz name a size, which not every window manager holds to the screen's
void keepOnScreen(QWidget& window) {
  const QWindow* shown = window.windowHandle();
  if (shown == nullptr) return;
  window.resize(window.size().boundedTo(shown->screen()->availableGeometry().size()));
}

QString text(const std::string& words) { return QString::fromStdString(words); }

QString number(double value) { return text(pmeta::shortNumber(value)); }

QString stateStyle(const std::string& state) {
  if (state == "running" || state == "finished") return "color: #1b7f3b; font-weight: bold";
  if (state == "late" || state == "lost" || state == "stopped") {
    return "color: #b3261e; font-weight: bold";
  }
  return "color: #8a5a00; font-weight: bold";
}

// an item that did not change is not painted again
void setCell(QTableWidget* table, int row, int column, const QString& words,
             const QString& tip = QString()) {
  QTableWidgetItem* item = table->item(row, column);
  if (item == nullptr) {
    item = new QTableWidgetItem;
    if (column != kTask && column != kAgent)
      item->setTextAlignment(Qt::AlignRight | Qt::AlignVCenter);
    if (column == kPersonal) item->setForeground(QColor(0xd8, 0x1b, 0x60));
    if (column == kMeta) item->setForeground(QColor(0x0b, 0x4f, 0xb3));
    table->setItem(row, column, item);
  }
  if (item->text() != words) item->setText(words);
  item->setToolTip(tip);
}

}  // namespace

RunPanel::RunPanel(QWidget* parent) : rviz::Panel(parent), monitor_(new RunMonitor(this)) {
  build();
  follow();
  refresh();
}

QLabel* RunPanel::addLabel(const QString& name, const QString& style) {
  auto* label = new QLabel(this);
  label->setObjectName(name);
  label->setStyleSheet(style);
  label->setWordWrap(true);
  label->setTextFormat(Qt::PlainText);  // what comes by messages is no markup
  return label;
}

QPushButton* RunPanel::addButton(const QString& name, const QString& text) {
  auto* button = new QPushButton(text, this);
  button->setObjectName(name);
  return button;
}

QLayout* RunPanel::buildNumbers() {
  personal_ = addLabel("pp", kPersonalStyle);
  meta_ = addLabel("mp", kMetaStyle);
  test_ = addLabel("test", kMetaStyle);
  eta_ = addLabel("eta", "");
  personal_->setToolTip("PP: mean return of the personal policies on their own tasks");
  meta_->setToolTip("MP: mean return of the meta-policy on the training tasks");
  test_->setToolTip("mean return of the meta-policy on the test tasks");
  auto* numbers = new QGridLayout;
  numbers->addWidget(personal_, 0, 0);
  numbers->addWidget(meta_, 0, 1);
  numbers->addWidget(eta_, 1, 0);
  numbers->addWidget(test_, 1, 1);
  return numbers;
}

void RunPanel::buildTable() {
  tasks_ = new QTableWidget(0, kColumns, this);
  tasks_->setObjectName("tasks");
  tasks_->setHorizontalHeaderLabels({"task", "personal", "meta", "agent", "updates/s"});
  tasks_->verticalHeader()->hide();
  tasks_->verticalHeader()->setDefaultSectionSize(tasks_->fontMetrics().height() + 6);
  tasks_->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  tasks_->horizontalHeader()->setMinimumSectionSize(20);
  tasks_->horizontalHeader()->setSectionResizeMode(kTask, QHeaderView::Stretch);
  tasks_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  tasks_->setSelectionMode(QAbstractItemView::NoSelection);
  tasks_->setFocusPolicy(Qt::NoFocus);
  tasks_->setShowGrid(false);
  tasks_->setWordWrap(false);
  tasks_->setAlternatingRowColors(true);
}

void RunPanel::build() {
  experiment_ = addLabel("experiment", "font-weight: bold");
  state_ = addLabel("state", "");
  state_->setAlignment(Qt::AlignRight);
  auto* head = new QHBoxLayout;
  head->addWidget(experiment_, 1);
  head->addWidget(state_);

  progress_ = new QProgressBar(this);
  progress_->setObjectName("progress");
  progress_->setAlignment(Qt::AlignCenter);

  QLayout* numbers = buildNumbers();
  missing_ = addLabel("missing", kWarningStyle);
  message_ = addLabel("message", kFaintStyle);

  buildTable();
  pause_ = addButton("pause", "Pause");
  evaluate_ = addButton("evaluate", "Evaluate now");
  checkpoint_ = addButton("checkpoint", "Save checkpoint");
  auto* buttons = new QHBoxLayout;
  for (QPushButton* button : {pause_, evaluate_, checkpoint_}) buttons->addWidget(button);
  answer_ = addLabel("answer", kFaintStyle);
  // an answer must not push the buttons away from under the mouse
  answer_->setMinimumHeight(2 * answer_->fontMetrics().lineSpacing());
  answer_->setAlignment(Qt::AlignTop);

  auto* all = new QVBoxLayout(this);
  all->addLayout(head);
  all->addWidget(progress_);
  all->addLayout(numbers);
  all->addWidget(missing_);
  all->addWidget(message_);
  all->addWidget(tasks_, 1);
  all->addLayout(buttons);
  all->addWidget(answer_);
  resize(kWidth, height());
}

void RunPanel::follow() {
  throttle_.setSingleShot(true);
  throttle_.setInterval(kRefreshAfter);
  connect(&throttle_, &QTimer::timeout, this, [this] { refresh(); });
  connect(&clock_, &QTimer::timeout, this, [this] { refresh(); });
  clock_.start(kClockInterval);
  connect(monitor_, &RunMonitor::changed, this, [this] {
    if (!throttle_.isActive()) throttle_.start();
  });
  connect(monitor_, &RunMonitor::answered, this,
          [this](bool success, const QString& text) { showAnswer(success, text); });
  connect(pause_, &QPushButton::clicked, this, [this] {
    monitor_->ask(pause_->text() == "Resume" ? Request::kResume : Request::kPause);
    refresh();
  });
  connect(evaluate_, &QPushButton::clicked, this, [this] {
    monitor_->ask(Request::kEvaluate);
    refresh();
  });
  connect(checkpoint_, &QPushButton::clicked, this, [this] {
    monitor_->ask(Request::kCheckpoint);
    refresh();
  });
}

void RunPanel::onInitialize() {
  rviz::WindowManagerInterface* manager = vis_manager_->getWindowManager();
  auto* window =
      manager == nullptr ? nullptr : qobject_cast<QMainWindow*>(manager->getParentWindow());
  if (window == nullptr || window->centralWidget() == nullptr) return;
  window->installEventFilter(this);
  window->centralWidget()->installEventFilter(this);
  fitView(window->centralWidget()->size());
}

bool RunPanel::eventFilter(QObject* watched, QEvent* event) {
  auto* widget = qobject_cast<QWidget*>(watched);
  const bool is_window = widget != nullptr && widget->isWindow();
  if (is_window && event->type() == QEvent::Show) keepOnScreen(*widget);
  if (!is_window && event->type() == QEvent::Resize) {
    fitView(static_cast<QResizeEvent*>(event)->size());
  }
  return rviz::Panel::eventFilter(watched, event);
}

void RunPanel::fitView(const QSize& window) {
  rviz::ViewController* view = vis_manager_->getViewManager()->getCurrent();
  if (view == nullptr || view->getClassId() != kFlatView) return;
  // in pixels for a unit of the scene
  view->subProp("Scale")->setValue(std::min(window.width() / (kSceneWidth + kMargin),
                                            window.height() / (kSceneHeight + kMargin)));
}

void RunPanel::refresh() {
  const RunState state = monitor_->takeState();
  showSummary(state);
  showTasks(state);
  showButtons(state);
}

void RunPanel::showSummary(const RunState& state) {
  const std::string words = state.stateText();
  state_->setText(text(words));
  state_->setStyleSheet(stateStyle(words));
  message_->setText(text(state.messageText()));
  missing_->setText(text(state.missingText()));
  missing_->setVisible(!missing_->text().isEmpty());

  const bool known = state.summary.has_value();
  for (QWidget* widget :
       {static_cast<QWidget*>(progress_), static_cast<QWidget*>(personal_),
        static_cast<QWidget*>(meta_), static_cast<QWidget*>(eta_), static_cast<QWidget*>(tasks_)}) {
    widget->setVisible(known);
  }
  test_->setVisible(known && std::isfinite(state.summary->test_return));
  experiment_->setText(known ? text(state.summary->experiment) : "pMeta");
  if (!known) return;
  experiment_->setToolTip("run " + text(state.summary->run_id));
  progress_->setRange(0, static_cast<int>(std::max(1u, state.summary->rounds)));
  progress_->setValue(static_cast<int>(state.summary->round));
  progress_->setFormat(text(state.roundText()));
  personal_->setText("PP " + number(state.summary->personal_return));
  meta_->setText("MP " + number(state.summary->meta_return));
  test_->setText("test " + number(state.summary->test_return));
  eta_->setText("ETA " + text(state.etaText()));
}

void RunPanel::showTasks(const RunState& state) {
  const auto now = std::chrono::steady_clock::now();
  const int rows = static_cast<int>(state.tasks.size());
  if (tasks_->rowCount() != rows) tasks_->setRowCount(rows);
  tasks_->horizontalHeaderItem(kTask)->setText(text(state.tableText()));
  int row = 0;
  for (const auto& [index, task] : state.tasks) {
    const QString tip = text("task " + std::to_string(index) + ", " + task.name);
    setCell(tasks_, row, kTask, text(task.name), tip + (task.is_test ? ", a test task" : ""));
    setCell(tasks_, row, kPersonal, number(state.shown(task.personal).mean));
    setCell(tasks_, row, kMeta, number(state.shown(task.meta).mean));
    setCell(tasks_, row, kAgent, text(state.agentText(task, now)),
            task.status ? text(task.status->message) : QString());
    setCell(tasks_, row, kSpeed,
            task.status && task.status->updates_per_s > 0
                ? text(pmeta::shortCount(task.status->updates_per_s))
                : "-");
    ++row;
  }
}

void RunPanel::showButtons(const RunState& state) {
  const bool paused = state.paused();
  pause_->setText(paused ? "Resume" : "Pause");
  showButton(pause_, Request::kPause, state.active(),
             paused ? "let the next meta-policy go out"
                    : "hold the next meta-policy back; the result stays the same");
  showButton(evaluate_, Request::kEvaluate, state.active(),
             "evaluate the next meta-policy, whatever the schedule; the result stays the same");
  showButton(checkpoint_, Request::kCheckpoint, state.active(), "save the run as it is");
}

void RunPanel::showButton(QPushButton* button, Request request, bool active, const QString& tip) {
  const QString service = text(serviceOf(request));
  const bool offered = monitor_->offers(request);
  button->setEnabled(active && offered && !monitor_->busy());
  if (!active) {
    button->setToolTip("no run goes on");
  } else if (!offered) {
    button->setToolTip("the run does not offer the service " + service);
  } else {
    button->setToolTip(monitor_->busy() ? "waiting for an answer" : tip + " (" + service + ")");
  }
}

void RunPanel::showAnswer(bool success, const QString& text) {
  answer_->setStyleSheet(success ? kFaintStyle : kWarningStyle);
  answer_->setText(text);
  refresh();
}

}  // namespace pmeta_nodes

PLUGINLIB_EXPORT_CLASS(pmeta_nodes::RunPanel, rviz::Panel)
