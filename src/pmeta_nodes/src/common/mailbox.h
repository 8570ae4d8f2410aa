#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>

namespace pmeta_nodes {

/// Hands messages from ROS callbacks to one worker thread. When full, the oldest message is
/// dropped: with capacity 1 the worker always gets the newest.
template <class T>
class Mailbox {
 public:
  explicit Mailbox(std::size_t capacity) : capacity_(capacity) {}  ///< `capacity`: at least 1

  /// Does nothing once the box is closed; never waits.
  void push(T item) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (closed_) return;
      if (items_.size() == capacity_) items_.pop_front();
      items_.push_back(std::move(item));
    }
    arrived_.notify_one();
  }

  /// The oldest message; nothing after `wait` without one, or when the mailbox is closed.
  std::optional<T> pop(std::chrono::duration<double> wait) {
    std::unique_lock<std::mutex> lock(mutex_);
    arrived_.wait_for(lock, wait, [this] { return closed_ || !items_.empty(); });
    if (closed_ || items_.empty()) return std::nullopt;
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    return item;
  }

  /// Wakes the worker for good.
  void close() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      closed_ = true;
    }
    arrived_.notify_all();
  }

 private:
  const std::size_t capacity_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<T> items_;
  bool closed_ = false;
};

}  // namespace pmeta_nodes
