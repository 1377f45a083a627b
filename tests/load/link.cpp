#include "tests/load/link.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/motion/portable.h"
#include "tests/load/clock.h"
#include "tests/load/units.h"

namespace catgs::load {
namespace {

constexpr std::int64_t min_retransmission_timeout_us = 200'000;  // Linux's TCP_RTO_MIN
constexpr std::size_t min_queue_bytes = 2 * LinkShaper::segment_bytes;

/// Returns the text before the first `mark`; `text` keeps the text after it.
std::string_view take_until(std::string_view& text, char mark) {
  const std::size_t at = std::min(text.find(mark), text.size());
  const std::string_view part = text.substr(0, at);
  text.remove_prefix(std::min(at + 1, text.size()));
  return part;
}

/// "50mbit" or "50mbit@10s".
RateStep parse_step(std::string_view source, std::string_view text) {
  const std::string_view rate = take_until(text, '@');
  return {text.empty() ? 0 : microseconds(parse_duration_s(source, text)),
          parse_bits_per_s(source, rate)};
}

void add_step(std::string_view source, RateSchedule& schedule, RateStep step) {
  const bool fits = schedule.empty() ? step.from_us == 0 : step.from_us > schedule.back().from_us;
  if (!fits) {
    throw InputError(source, "", "rates have to begin at 0s and be in time order",
                     "like rate=50mbit@0s,5mbit@10s");
  }
  schedule.push_back(step);
}

/// The seed of "4g:7".
std::uint64_t parse_seed(std::string_view source, std::string_view text) {
  std::uint64_t seed = 0;
  const std::string_view digits = text.substr(text.find(':') + 1);
  const char* end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, seed);
  if (error == std::errc() && stop == end) return seed;
  throw InputError(source, "", fmt::format("\"{}\" is not a seed", digits), "like rate=4g:7");
}

double parse_burst(std::string_view source, std::string_view text) {
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error == std::errc() && stop == end && value >= 1.0 && value <= 1000.0) return value;
  throw InputError(source, "", fmt::format("\"{}\" is not a number of segments", text),
                   "1 to 1000");
}

void set_value(std::string_view source, std::string_view key, std::string_view value,
               LinkSettings& link) {
  const auto duration_us = [&] { return microseconds(parse_duration_s(source, value)); };
  if (key == "rate" && value.starts_with("4g:")) {
    for (const RateStep& step : mobile_rates(parse_seed(source, value)))
      add_step(source, link.down, step);
  } else if (key == "rate") {
    add_step(source, link.down, parse_step(source, value));
  } else if (key == "up") {
    add_step(source, link.up, parse_step(source, value));
  } else if (key == "delay") {
    link.delay_us = duration_us();
  } else if (key == "jitter") {
    link.jitter_us = duration_us();
  } else if (key == "queue") {
    link.queue_us = duration_us();
  } else if (key == "loss") {
    link.loss = parse_share(source, value);
  } else if (key == "burst") {
    link.burst = parse_burst(source, value);
  } else if (key == "congestion") {
    if (value != "cubic" && value != "none")
      throw InputError(source, "", fmt::format("\"{}\" is not a congestion control", value),
                       "cubic or none");
    link.cubic = value == "cubic";
  } else {
    throw InputError(source, "", fmt::format("a link has no \"{}\"", key),
                     "rate, up, delay, jitter, loss, burst, queue or congestion");
  }
}

}  // namespace

RateSchedule mobile_rates(std::uint64_t seed) {
  constexpr int steps = 1200, step_us = 500'000;
  constexpr double median_mbit = 12.0, deviation = 0.8, correlation_s = 5.0;
  constexpr double between_handovers_s = 25.0, handover_mbit = 0.5;
  const double kept = std::exp(-1e-6 * step_us / correlation_s);
  const double handover_share = 1e-6 * step_us / between_handovers_s;
  PortableRng random(seed);
  RateSchedule rates;
  double logarithm = deviation * random.normal();
  int cut_steps = 0;
  for (int i = 0; i < steps; ++i) {
    const double mbit = std::clamp(median_mbit * std::exp(logarithm), handover_mbit, 80.0);
    if (cut_steps == 0 && random.uniform(0.0, 1.0) < handover_share)
      cut_steps = 1 + static_cast<int>(random.uniform(0.0, 3.0));
    rates.push_back({std::int64_t{i} * step_us, 1e6 * (cut_steps > 0 ? handover_mbit : mbit)});
    cut_steps = std::max(0, cut_steps - 1);
    logarithm = kept * logarithm + std::sqrt(1.0 - kept * kept) * deviation * random.normal();
  }
  return rates;
}

LinkSettings parse_link(std::string_view source, std::string_view text) {
  LinkSettings link;
  link.text = text;
  std::string_view key;
  while (!text.empty()) {
    std::string_view value = take_until(text, ',');
    // A part without a key continues the list of the one before.
    if (value.find('=') != std::string_view::npos) key = take_until(value, '=');
    set_value(fmt::format("{}: {}", source, key.empty() ? "?" : key), key, value, link);
  }
  if (link.up.empty()) link.up = link.down;
  if (link.loss > 0.5) {
    throw InputError(source, "loss", "no connection survives the loss of every other segment",
                     "at most 50%");
  }
  return link;
}

LinkShaper::LinkShaper(const LinkSettings& link, RateSchedule rate, std::uint64_t seed)
    : link_(link), rate_(std::move(rate)), random_(static_cast<unsigned>(seed % 0x7ffffffe) + 1) {
  const bool late = link_.delay_us > 0 || link_.jitter_us > 0 || link_.loss > 0.0;
  windowed_ = link_.cubic && (late || !rate_.empty());
}

double LinkShaper::rate_at(std::int64_t time_us) const {
  const auto next = std::ranges::upper_bound(rate_, time_us, {}, &RateStep::from_us);
  return next == rate_.begin() ? rate_.front().bits_per_s : std::prev(next)->bits_per_s;
}

std::int64_t LinkShaper::carried_at(std::int64_t begin_us, std::size_t bytes) const {
  if (rate_.empty()) return begin_us;
  double bits = 8.0 * static_cast<double>(bytes);
  auto next = std::ranges::upper_bound(rate_, begin_us, {}, &RateStep::from_us);
  for (std::int64_t time_us = begin_us;; time_us = next->from_us, ++next) {
    const double bits_per_us = 1e-6 * rate_at(time_us);
    const bool last = next == rate_.end();
    const double capacity =
        last ? bits : bits_per_us * static_cast<double>(next->from_us - time_us);
    if (capacity >= bits && bits_per_us > 0.0)
      return time_us + static_cast<std::int64_t>(std::ceil(bits / bits_per_us));
    if (last) return never_us;  // an outage without an end
    bits -= capacity;
  }
}

void LinkShaper::forget_departed(std::int64_t now_us) {
  while (!queue_.empty() && queue_.front().time_us <= now_us) {
    queued_bytes_ -= queue_.front().bytes;
    queue_.pop_front();
  }
}

void LinkShaper::notice(std::int64_t now_us) {
  while (!notices_.empty() && notices_.begin()->first <= now_us) {
    const auto [time_us, known] = *notices_.begin();
    notices_.erase(notices_.begin());
    if (known.kind == Notice::Kind::acked) window_.acked(known.sent_us, time_us);
    if (known.kind == Notice::Kind::lost) window_.lost(known.sent_us, time_us);
    if (known.kind == Notice::Kind::timed_out) window_.timed_out(time_us);
  }
}

std::size_t LinkShaper::buffer_room_bytes(std::int64_t now_us) const {
  if (rate_.empty()) return SIZE_MAX;
  const double buffered = rate_at(now_us) * 1e-6 * static_cast<double>(link_.queue_us) / 8.0;
  const std::size_t buffer = std::max(min_queue_bytes, static_cast<std::size_t>(buffered));
  return buffer - std::min(buffer, queued_bytes_);
}

std::size_t LinkShaper::room_bytes(std::int64_t now_us) {
  forget_departed(now_us);
  notice(now_us);
  const std::size_t buffer = buffer_room_bytes(now_us);
  if (!windowed_) return buffer;
  const double open = std::floor(window_.segments() - window_.in_flight());
  const std::size_t window = open < 1.0 ? 0 : static_cast<std::size_t>(open) * segment_bytes;
  // It would be sent, and there is no room for it.
  if (window > 0 && buffer < segment_bytes && now_us >= overflow_known_us_) overflows_ = true;
  return std::min(buffer, window);
}

std::int64_t LinkShaper::next_room_us() const {
  std::int64_t next_us = queue_.empty() ? 0 : queue_.front().time_us;
  if (!notices_.empty() && (queue_.empty() || notices_.begin()->first < next_us))
    next_us = notices_.begin()->first;
  return next_us;
}

std::int64_t LinkShaper::recovery_us(std::int64_t queueing_us) {
  const std::int64_t round_trip_us = 2 * link_.delay_us + queueing_us;
  if (std::exchange(overflows_, false)) return std::max<std::int64_t>(1, round_trip_us);
  if (link_.loss <= 0.0) return 0;
  // A two-state chain: losses come with this share and in runs of this mean length.
  const double goes_on = 1.0 - 1.0 / link_.burst;
  const double begins = link_.loss / (link_.burst * (1.0 - link_.loss));
  std::uniform_real_distribution<double> uniform;
  if (uniform(random_) >= (lost_in_a_row_ > 0 ? goes_on : begins)) {
    lost_in_a_row_ = 0;
    return 0;
  }
  const bool repeats_at_once = ++lost_in_a_row_ < 3;  // by the acks of those behind it
  return round_trip_us + (repeats_at_once ? 0 : min_retransmission_timeout_us);
}

std::int64_t LinkShaper::send(std::size_t bytes, std::int64_t now_us) {
  forget_departed(now_us);
  notice(now_us);
  last_departure_us_ = carried_at(std::max(now_us, last_departure_us_), bytes);
  if (!rate_.empty()) {
    queue_.push_back({last_departure_us_, bytes});
    queued_bytes_ += bytes;
  }
  const std::int64_t queueing_us = last_departure_us_ - now_us;
  std::uniform_int_distribution<std::int64_t> jitter_us(0, link_.jitter_us);
  const std::int64_t first_arrival_us = last_departure_us_ + link_.delay_us + jitter_us(random_);
  const bool overflows = overflows_;
  const std::int64_t repeated_us = recovery_us(queueing_us);
  const std::int64_t arrival_us = first_arrival_us + repeated_us;
  if (windowed_) {
    window_.sent(now_us);
    notices_.insert({arrival_us + link_.delay_us, {Notice::Kind::acked, now_us}});
    const std::int64_t known_us = first_arrival_us + link_.delay_us;  // by acks of the next ones
    if (repeated_us > 2 * link_.delay_us + queueing_us + 1)
      notices_.insert({arrival_us - link_.delay_us, {Notice::Kind::timed_out, now_us}});
    else if (repeated_us > 0)
      notices_.insert({known_us, {Notice::Kind::lost, now_us}});
    if (overflows) overflow_known_us_ = known_us;
  }
  last_arrival_us_ = std::max(last_arrival_us_, arrival_us);  // in order, as TCP gives them
  return last_arrival_us_;
}

}  // namespace catgs::load
