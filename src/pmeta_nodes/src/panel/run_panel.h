#pragma once

#include <QTimer>

#ifndef Q_MOC_RUN
#include <rviz/panel.h>

#include "panel/run_monitor.h"
#endif

class QLabel;
class QLayout;
class QProgressBar;
class QPushButton;
class QTableWidget;

namespace pmeta_nodes {

/// The rviz panel of a run: where it stands, its returns task by task, what its agents do, and
/// buttons for what its nodes offer as services. Shows the run below pmeta in rviz's
/// own namespace; only looks on until a button is
/// used.
class RunPanel : public rviz::Panel {
  Q_OBJECT

 public:
  explicit RunPanel(QWidget* parent = nullptr);  ///< as pluginlib wants it

  /// Keeps the scene as large as the window allows, and the window within the screen as it is
  /// shown.
  void onInitialize() override;
  /// Sees when the window takes another size.
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void fitView(const QSize& window);
  void build();
  QLayout* buildNumbers();
  void buildTable();
  QLabel* addLabel(const QString& name, const QString& style);
  QPushButton* addButton(const QString& name, const QString& text);
  void follow();

  void refresh();
  void showSummary(const RunState& state);
  void showTasks(const RunState& state);
  void showButtons(const RunState& state);
  void showButton(QPushButton* button, Request request, bool active, const QString& tip);
  void showAnswer(bool success, const QString& text);

  RunMonitor* monitor_;
  QTimer throttle_;  ///< from a change to its being shown
  QTimer clock_;     ///< for what changes by nothing happening

  QLabel* experiment_;
  QLabel* state_;
  QProgressBar* progress_;
  QLabel* personal_;
  QLabel* meta_;
  QLabel* test_;
  QLabel* eta_;
  QLabel* missing_;
  QLabel* message_;
  QTableWidget* tasks_;
  QPushButton* pause_;
  QPushButton* evaluate_;
  QPushButton* checkpoint_;
  QLabel* answer_;
};

}  // namespace pmeta_nodes
