#include "cli/progress.h"

#include <algorithm>
#include <cmath>

namespace brume {
namespace {

constexpr int kBarWidth = 30;
// A terminal repaints often enough to look alive; a log wants a line each ten percent, and where
// nobody asked for one, none of runs that are over in a moment.
constexpr std::chrono::milliseconds kRepaint(100), kUnaskedLine(5000);
constexpr int kPlainStep = 10;

ProgressStyle resolved(const CommandContext& context) {
  if (context.verbosity < 0) return ProgressStyle::None;
  if (context.progress == ProgressStyle::Auto || context.progress == ProgressStyle::Bar)
    return context.err_is_terminal ? ProgressStyle::Bar : ProgressStyle::Plain;
  return context.progress;
}

}  // namespace

Progress::Progress(const CommandContext& context)
    : stream_(context.err),
      style_(resolved(context)),
      is_asked_for_(context.progress != ProgressStyle::Auto),
      shown_at_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  if (is_line_open_) stream_ << '\n';
}

void Progress::update(const std::string& stage, double fraction) {
  const std::lock_guard lock(mutex_);
  if (stage != stage_) {
    finish_locked();
    stage_ = stage;
    fraction_ = 0;
    shown_percent_ = -1;
  }
  // Written so that NaN keeps what was known.
  if (fraction > fraction_) fraction_ = std::min(fraction, 1.0);
  show(false);
}

void Progress::finish() {
  const std::lock_guard lock(mutex_);
  finish_locked();
}

void Progress::finish_locked() {
  if (stage_.empty()) return;
  fraction_ = 1;
  show(true);
  stage_.clear();
}

void Progress::show(bool last) {
  if (style_ == ProgressStyle::None) return;
  const int percent = static_cast<int>(fraction_ * 100);
  const auto now = std::chrono::steady_clock::now();
  if (style_ == ProgressStyle::Plain) {
    const int step = percent - percent % kPlainStep;
    const bool is_due =
        is_asked_for_ || now - shown_at_ >= kUnaskedLine || (last && shown_percent_ >= 0);
    if (step > shown_percent_ && is_due) {
      shown_at_ = now;
      stream_ << stage_ << ": " << step << " %\n" << std::flush;
      shown_percent_ = step;
    }
    return;
  }
  if (percent == shown_percent_ && !last) return;
  if (!last && shown_percent_ >= 0 && now - shown_at_ < kRepaint) return;
  const int filled = static_cast<int>(fraction_ * kBarWidth);
  stream_ << '\r' << stage_ << " [" << std::string(filled, '#')
          << std::string(kBarWidth - filled, '.') << "] " << percent << " %\x1b[K" << std::flush;
  shown_percent_ = percent;
  shown_at_ = now;
  is_line_open_ = !last;
  if (last) stream_ << '\n';
}

std::function<void(const std::string&, double)> Progress::callback() {
  return [this](const std::string& stage, double fraction) { update(stage, fraction); };
}

std::function<void(double)> Progress::callback(const std::string& stage) {
  return [this, stage](double fraction) { update(stage, fraction); };
}

}  // namespace brume
