#include "tests/load/decode_stage.h"

#include <algorithm>
#include <utility>

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "tests/load/clock.h"
#include "tests/load/unpacked_depths.h"
#include "tests/load/waiting.h"

namespace catgs::load {
namespace {

namespace asio = boost::asio;

constexpr std::size_t max_queued = 16;
constexpr std::int64_t min_stills_apart_us = 10'000;
constexpr std::size_t max_stills = 120;

std::size_t depth_bytes(const v1::FrameHeader& header) {
  return sizeof(float) * std::size_t{header.depth_columns()} * header.depth_rows();
}

/// Without cells where there are none. Nothing: they are broken.
std::optional<Depths> depths_of(const v1::FrameHeader& header) {
  if (header.depth_columns() == 0) return Depths{};
  const auto* codes = reinterpret_cast<const std::byte*>(header.depth_codes().data());
  const glm::ivec2 cells(header.depth_columns(), header.depth_rows());
  auto unpacked =
      unpack({cells, header.depth_scale(), {codes, codes + header.depth_codes().size()}});
  if (!unpacked) return {};
  return Depths{cells, std::move(*unpacked)};
}

}  // namespace

DecodeStage::DecodeStage(const SessionSettings& settings, asio::thread_pool& decoders,
                         SessionReport& report, Callbacks callbacks,
                         const asio::any_io_executor& executor)
    : settings_(settings),
      decoders_(decoders),
      report_(report),
      callbacks_(std::move(callbacks)),
      filled_(executor),
      decoder_lost_us_(now_us()) {}

bool DecodeStage::has_work() const {
  if (!settings_.manners.decode) return settings_.manners.decode_time_s > 0.0;
  return !settings_.manners.only_pictures || picture_is_due();
}

bool DecodeStage::picture_is_due() const {
  const auto kept =
      static_cast<std::size_t>(std::ranges::count(report_.pictures, 0, &PictureSample::rest));
  if (kept == settings_.pictures) return false;
  const double part = (static_cast<double>(kept) + 0.5) / static_cast<double>(settings_.pictures);
  const auto span_us = static_cast<double>(settings_.stop_us - settings_.start_us);
  return now_us() >= settings_.start_us + static_cast<std::int64_t>(part * span_us);
}

void DecodeStage::lose_decoder() {
  const std::int64_t every_us = microseconds(settings_.manners.lose_decoder_every_s);
  if (every_us == 0 || now_us() < decoder_lost_us_ + every_us) return;
  decoder_lost_us_ = now_us();
  ++report_.stats.counts.decoders_lost;
  codec_.reset();  // the next item gets a decoder of its own
  wait_for_idr_ = true;
  for (Item& item : std::exchange(queue_, {})) {
    item.ack.set_dropped(true);
    callbacks_.acknowledge(item.ack, 0);
  }
}

void DecodeStage::take(const FrameMessage& frame, const v1::Ack& ack) {
  lose_decoder();
  const bool independent = frame.header.idr() || frame.header.codec() == v1::CODEC_MJPEG;
  const bool full = queue_.size() == max_queued;
  wait_for_idr_ = full || (wait_for_idr_ && !independent);
  if (wait_for_idr_ && settings_.manners.only_pictures) {
    callbacks_.acknowledge(ack, now_us());
    return callbacks_.request_idr();
  }
  if (wait_for_idr_) {
    ++report_.stats.counts.frames_skipped;
    v1::Ack dropped = ack;
    dropped.set_dropped(true);
    callbacks_.acknowledge(dropped, 0);
    return callbacks_.request_idr();
  }
  queue_.push_back({frame.header, {frame.bitstream.begin(), frame.bitstream.end()}, ack});
  filled_.cancel();
}

asio::awaitable<void> DecodeStage::run() {
  while (true) {
    while (queue_.empty()) co_await signal_of(filled_);
    Item item = std::move(queue_.front());
    queue_.pop_front();
    co_await decode(item);
  }
}

asio::awaitable<void> DecodeStage::decode(Item& item) {
  const std::int64_t begin_us = now_us();
  if (settings_.manners.decode) {
    Decoded decoded = co_await decode_on_pool(item);
    const bool fits =
        decoded.picture.size_px == glm::ivec2(item.header.width_px(), item.header.height_px());
    if (!decoded.status.ok || !fits) {
      ++report_.stats.counts.decode_errors;
      report_.stats.error(fits || !decoded.status.ok
                              ? "a frame cannot be decoded: " + decoded.status.message
                              : "a decoded picture has another size than its header says");
      wait_for_idr_ = true;
      item.ack.set_dropped(true);
      callbacks_.request_idr();
    } else {
      report_.stats.frame_decoded(decoded.duration_us);
      keep_still(item, decoded);
      keep_picture(item, decoded);
      keep_frame(item);
    }
  }
  if (settings_.manners.decode_time_s > 0.0)
    co_await wait_until(clock_time(begin_us + microseconds(settings_.manners.decode_time_s)));
  callbacks_.acknowledge(item.ack, now_us());
}

asio::awaitable<DecodeStage::Decoded> DecodeStage::decode_on_pool(const Item& item) {
  if (codec_ != item.header.codec()) {
    decoder_ = std::make_unique<Decoder>(item.header.codec() == v1::CODEC_MJPEG ? Codec::mjpeg
                                                                                : Codec::h264);
    codec_ = item.header.codec();
    decoder_is_new_ = true;
  }
  // On the pool, so that decoding one session delays no other session's time stamps. The end of the
  // run does not cancel it: co_spawn would send the cancellation to the pool's thread, where the
  // picture may be finished and all that it refers to gone.
  co_return co_await asio::co_spawn(
      asio::make_strand(decoders_),
      [&decoder = *decoder_, &item]() -> asio::awaitable<Decoded> {
        Decoded decoded;
        const std::int64_t start_us = now_us();
        decoded.status = decoder.decode(item.bitstream, decoded.picture);
        decoded.duration_us = now_us() - start_us;
        co_return decoded;
      },
      asio::bind_cancellation_slot(asio::cancellation_slot(), asio::use_awaitable));
}

void DecodeStage::keep_picture(const Item& item, Decoded& decoded) {
  if (!picture_is_due()) return;
  wait_for_idr_ = wait_for_idr_ || settings_.manners.only_pictures;
  report_.pictures.push_back({.render_pose = from_wire(item.header.render_pose()),
                              .fov_y_rad = item.header.fov_y_rad(),
                              .near_z = scene_.near_z(),
                              .scene_id = scene_.scene_id(),
                              .picture = std::move(decoded.picture),
                              .stereo = stereo_of(item.header)});
}

void DecodeStage::keep_frame(Item& item) {
  if (!report_.display || report_.display->full) return;
  DisplayLog& log = *report_.display;
  if (!log.take_room(item.bitstream.size() + depth_bytes(item.header)))
    return report_.stats.error("the run is too long: no further frame is judged");
  log.near_z = scene_.near_z();
  log.scene_id = scene_.scene_id();
  std::optional<Depths> depths = depths_of(item.header);
  if (!depths) report_.stats.error("the depths of a frame cannot be unpacked");
  log.frames.push_back({.eye = {from_wire(item.header.render_pose()), item.header.fov_y_rad()},
                        .size_px = {item.header.width_px(), item.header.height_px()},
                        .depths = depths ? std::move(*depths) : Depths{},
                        .pose_us = item.header.pose_client_time_us(),
                        .codec = *codec_ == v1::CODEC_MJPEG ? Codec::mjpeg : Codec::h264,
                        .first = std::exchange(decoder_is_new_, false),
                        .bitstream = std::move(item.bitstream)});
}

void DecodeStage::keep_still(const Item& item, const Decoded& decoded) {
  if (settings_.pictures == 0 || !report_.rest || report_.rest->number > max_rests) return;
  if (!item.header.still() || item.header.pose_id() != report_.rest->pose_id) return;
  if (report_.pictures.size() >= max_stills) return;
  const std::int64_t after_us = now_us() - report_.rest->since_us;
  const auto last = std::ranges::find(report_.pictures.rbegin(), report_.pictures.rend(),
                                      report_.rest->number, &PictureSample::rest);
  if (last != report_.pictures.rend() && after_us - last->after_us < min_stills_apart_us) return;
  report_.pictures.push_back({.render_pose = from_wire(item.header.render_pose()),
                              .fov_y_rad = item.header.fov_y_rad(),
                              .near_z = scene_.near_z(),
                              .scene_id = scene_.scene_id(),
                              .picture = decoded.picture,
                              .rest = report_.rest->number,
                              .after_us = after_us,
                              .stereo = stereo_of(item.header)});
}

}  // namespace catgs::load
