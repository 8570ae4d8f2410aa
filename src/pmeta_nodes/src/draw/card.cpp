#include "pmeta_nodes/card.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;
using visualization_msgs::MarkerArray;

namespace {

constexpr double kGap = 0.1;       // between cards
constexpr double kPadding = 0.06;  // inside a card
constexpr double kHeader = 2.7;    // heights in letters
constexpr double kLabel = 1.5;
constexpr double kReadable = 0.75;  // of a card's letters: what text may shrink to

const Color kGround = rgb(0xf3f4f6);
const Color kTestGround = rgb(0xfaf3df);
const Color kBorder = rgb(0xc4c8d0);

Cards arrange(int num_tasks, int num_train, int lanes, int columns, bool beside) {
  Cards cards;
  cards.num_tasks = num_tasks;
  cards.num_train = num_train;
  cards.lanes = lanes;
  cards.beside = beside;
  cards.columns = columns;
  const int rows = (num_tasks + columns - 1) / columns;
  cards.slot_width = kSceneWidth / columns;
  cards.slot_height = (kSceneHeight - kTitleHeight - kLegendHeight) / rows;
  cards.letter = std::min(0.18, 0.08 * cards.slot_height);
  const double width = cards.width() - 2 * kPadding;
  const double height = cards.height() - kPadding - kHeader * cards.letter;
  const int across = beside ? lanes : 1;
  const int down = beside ? 1 : lanes;
  cards.lane_width = (width - (across - 1) * kPadding) / across;
  cards.lane_height = height / down - kLabel * cards.letter;
  return cards;
}

/// The text with its long decimals rounded to four digits.
std::string shortNumbers(const std::string& text) {
  constexpr std::size_t kLong = 7;
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t end = std::min(text.find_first_not_of("0123456789.", i), text.size());
    const std::string word = text.substr(i, end - i);
    if (word.size() < kLong || word.find('.') == std::string::npos) {
      out += word;
    } else {
      char rounded[32];
      std::snprintf(rounded, sizeof rounded, "%.4g", std::strtod(word.c_str(), nullptr));
      out += rounded;
    }
    if (end < text.size()) out += text[end];
    i = end + 1;
  }
  return out;
}

/// A task's description as it fits on a card: where it is too long, what stands before a colon is
/// left out.
std::string shortDescription(const std::string& description, double letter, double width) {
  const std::string text = shortNumbers(description);
  const std::size_t colon = text.find(": ");
  const bool fits = kLetterWidth * static_cast<double>(text.size()) * kReadable * letter <= width;
  return fits || colon == std::string::npos ? text : text.substr(colon + 2);
}

/// Which task a policy that explored takes it for, and how surely; "" where it does not say.
std::string guessText(const Cards& cards, const PolicyView& view, bool brief) {
  if (!view.episode || cards.num_train < 2) return "";
  const std::vector<double>& weights = view.episode->task_weights;
  if (weights.size() != static_cast<std::size_t>(cards.num_train)) return "";
  const auto likeliest = std::max_element(weights.begin(), weights.end());
  const std::string task = "task " + std::to_string(likeliest - weights.begin());
  if (brief) return ", as " + task;
  return ", takes it for " + task + " (" + std::to_string(std::lround(100 * *likeliest)) + " %)";
}

/// The round is named only where it is not the one that the title names; `brief` text has only the
/// policy and its return.
std::string labelText(const Cards& cards, const SceneContent& content, int task, int policy,
                      bool brief) {
  const bool is_meta = policy == Trajectory::META;
  if (!is_meta && cards.isTest(task)) return "";
  const PolicyView& view = viewOf(content, task, policy);
  const std::string name = is_meta ? "meta" : "personal";
  if (view.result && content.summary && view.result->round == content.summary->round) {
    return name + (brief ? " " : " return ") + number(view.result->return_mean) +
           guessText(cards, view, brief);
  }
  return name + ": " + resultText(view, content, is_meta);
}

/// What is known of both policies, above their lanes, in letters of one height.
void drawLabels(const Cards& cards, int task, const SceneContent& content, MarkerArray& scene) {
  const bool shared = cards.lanes == 1 && !cards.isTest(task);
  const double width = (shared ? 0.49 : 0.97) * cards.lane_width;
  const auto fittingLetter = [&](bool brief) {
    std::size_t longest = 1;
    for (const int policy : policiesOf(cards, task)) {
      longest = std::max(longest, labelText(cards, content, task, policy, brief).size());
    }
    return std::min(cards.letter, width / (kLetterWidth * longest));
  };
  const bool brief = fittingLetter(false) < kReadable * cards.letter;
  const double letter = fittingLetter(brief);
  for (const int policy : {Trajectory::PERSONAL, Trajectory::META}) {
    Point at = cards.laneBottom(task, policy);
    at.y += cards.lane_height + 0.5 * kLabel * cards.letter;
    if (shared) at.x += (policy == Trajectory::META ? 0.25 : -0.25) * cards.lane_width;
    scene.markers.push_back(textMarker(taskFrame(task), "results", policyId(task, policy), at,
                                       kTextLayer, labelText(cards, content, task, policy, brief),
                                       letter, width, policyColor(policy)));
  }
}

}  // namespace

double Cards::width() const { return slot_width - kGap; }
double Cards::height() const { return slot_height - kGap; }

Point Cards::laneBottom(int task, int policy) const {
  const double bottom = -height() / 2 + kPadding;
  const double pitch = lane_height + kLabel * letter;
  if (lanes == 1) return {0, bottom};
  // a test task's only lane stands in the middle
  if (isTest(task)) return beside ? Point{0, bottom} : Point{0, bottom + pitch / 2};
  const double side = policy == Trajectory::META ? 1 : -1;
  if (beside) return {side * (lane_width + kPadding) / 2, bottom};
  return {0, policy == Trajectory::META ? bottom : bottom + pitch};
}

Cards layoutCards(int num_tasks, int num_train, int lanes, double content_width,
                  double content_height) {
  Cards best;
  for (int columns = 1; columns <= num_tasks; ++columns) {
    for (const bool beside : {false, true}) {
      if (lanes == 1 && beside) continue;
      Cards cards = arrange(num_tasks, num_train, lanes, columns, beside);
      cards.scale = std::min(cards.lane_width / content_width, cards.lane_height / content_height);
      if (cards.scale > best.scale) best = cards;
    }
  }
  return best;
}

std::string taskFrame(int task) { return "task_" + std::to_string(task); }

std::vector<geometry_msgs::TransformStamped> cardFrames(const Cards& cards) {
  std::vector<geometry_msgs::TransformStamped> frames;
  for (int task = 0; task < cards.num_tasks; ++task) {
    const int row = task / cards.columns;
    const int in_row = std::min(cards.columns, cards.num_tasks - row * cards.columns);
    frames.push_back(
        shiftedFrame(kWorldFrame, taskFrame(task),
                     {(task % cards.columns - (in_row - 1) / 2.0) * cards.slot_width,
                      kSceneHeight / 2 - kTitleHeight - (row + 0.5) * cards.slot_height}));
  }
  return frames;
}

std::vector<int> policiesOf(const Cards& cards, int task) {
  if (cards.isTest(task)) return {Trajectory::META};
  return {Trajectory::PERSONAL, Trajectory::META};
}

void drawCards(const Cards& cards, const pmeta::EnvFamily& family, const SceneContent& content,
               MarkerArray& scene) {
  const double x = cards.width() / 2;
  const double y = cards.height() / 2;
  for (int task = 0; task < cards.num_tasks; ++task) {
    Figure ground(taskFrame(task), "cards", task, 0);
    constexpr double kLine = 0.012;
    ground.rectangle(-x, -y, x, y, kBorder);
    ground.raise();
    ground.rectangle(-x + kLine, -y + kLine, x - kLine, y - kLine,
                     cards.isTest(task) ? kTestGround : kGround);
    scene.markers.push_back(ground.take());
    const double width = 0.96 * cards.width();
    scene.markers.push_back(textMarker(taskFrame(task), "names", task, {0, y - 0.75 * cards.letter},
                                       kTextLayer, family.taskName(task), 1.1 * cards.letter, width,
                                       kInk));
    scene.markers.push_back(
        textMarker(taskFrame(task), "descriptions", task, {0, y - 1.95 * cards.letter}, kTextLayer,
                   shortDescription(family.taskDescription(task), cards.letter, width),
                   0.95 * cards.letter, width, kFaint));
    drawLabels(cards, task, content, scene);
  }
}

}  // namespace pmeta_nodes
