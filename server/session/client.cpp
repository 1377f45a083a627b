#include "server/session/client.h"

#include <utility>

#include <boost/asio/post.hpp>
#include <boost/asio/prefer.hpp>
#include <spdlog/spdlog.h>

#include "server/net/wire.h"
#include "server/session/log_session.h"
#include "server/session/session_registry.h"

namespace catgs {
namespace {

// Poses and acks at 240 Hz each, and room for bursts after a stall.
constexpr double messages_per_second = 600.0;
constexpr double message_burst = 1200.0;

}  // namespace

Client::Client(SessionRegistry& registry, std::shared_ptr<Connection> connection,
               std::string session_id)
    : registry_(registry),
      connection_(std::move(connection)),
      rate_(messages_per_second, message_burst, Clock::now()),
      executor_(registry.executor_),
      session_(std::move(session_id), registry.options_.policy, *this, Clock::now()) {}

Client::~Client() { executor_->close(std::move(stream_)); }

template <typename Handle>
void Client::post(Handle handle) {
  boost::asio::post(registry_.io_,
                    [self = shared_from_this(), handle = std::move(handle)]() mutable {
                      handle(*self);
                      self->registry_.give_frames();
                    });
}

void Client::on_message(std::span<const std::byte> bytes) {
  if (refused_) return;
  const TimePoint now = Clock::now();
  if (!rate_.take(now)) {
    refused_ = true;
    return post([](Client& c) { c.session_.fail(ErrorCode::rate_limited, "too many messages"); });
  }
  auto parsed = wire::parse_client_message(bytes);
  if (auto* error = std::get_if<wire::ParseError>(&parsed)) {
    refused_ = true;
    registry_.metrics_.bad_messages.Increment();
    return post([what = std::move(error->what)](Client& c) { c.session_.on_bad_message(what); });
  }
  auto& message = std::get<ClientMessage>(parsed);
  if (const auto* sample = std::get_if<PoseSample>(&message)) {
    registry_.metrics_.poses_received.Increment();
    if (latest_pose_.store({*sample, now}))
      post([](Client& c) { c.take_pose(); });
    else
      registry_.metrics_.poses_superseded.Increment();
    return;
  }
  post([message = std::move(message), now](Client& c) {
    if (const auto* ack = std::get_if<Ack>(&message)) {
      if (ack->presented_us > 0)
        c.registry_.metrics_.pose_age_seconds.Observe(1e-6 * ack->pose_age_us);
      if (ack->dropped) c.registry_.metrics_.frames_dropped_by_client.Increment();
    }
    c.session_.on_message(message, now);
  });
}

void Client::take_pose() {
  if (const auto pose = latest_pose_.take()) session_.on_message(pose->sample, pose->received);
}

void Client::on_frame_sent(const FrameTicket& ticket, std::size_t packet_bytes, TimePoint now) {
  Metrics& metrics = registry_.metrics_;
  metrics.frames_sent.Increment();
  metrics.bytes_sent.Increment(static_cast<double>(packet_bytes));
  metrics.observe_frame(ticket, now);
  // Not post(): nothing becomes due by it.
  boost::asio::post(registry_.io_, [self = shared_from_this(), ticket, packet_bytes] {
    self->session_.on_frame_sent(ticket, packet_bytes);
  });
}

void Client::on_close() {
  post([](Client& c) {
    c.session_.on_disconnected();
    c.registry_.remove(c);
  });
}

std::variant<Admission, ErrorMessage> Client::admit(const Hello& hello) {
  token_ = hello.token;
  auto result = registry_.admit(hello);
  if (const auto* admission = std::get_if<Admission>(&result)) {
    admitted_ = true;
    ++registry_.admitted_;
    registry_.metrics_.sessions_admitted.Increment();
    const LogSession about(session_.id());
    spdlog::info("{} looks at {}, {}x{}, {}", connection_->peer_address(),
                 admission->scene->facts.scene_id, hello.viewport_px.x, hello.viewport_px.y,
                 admission->encoder.text);
  }
  return result;
}

std::variant<std::shared_ptr<const SceneEntry>, ErrorMessage> Client::find_scene(
    const std::string& scene_id) {
  auto scene = registry_.find_scene(scene_id);
  if (const auto refusal = registry_.authorize_(token_, scene ? scene->facts.scene_id : scene_id))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, false};
  if (scene) return scene;
  return ErrorMessage{ErrorCode::unknown_scene, "there is no scene \"" + scene_id + "\" here",
                      false};
}

std::vector<std::string> Client::scene_ids() {
  std::vector<std::string> ids;
  for (const auto& scene : registry_.scenes_)
    if (!registry_.authorize_(token_, scene->facts.scene_id)) ids.push_back(scene->facts.scene_id);
  return ids;
}

std::uint32_t Client::session_count() { return registry_.admitted_; }

void Client::send(const ServerMessage& message) {
  if (const auto* error = std::get_if<ErrorMessage>(&message)) {
    const LogSession about(session_.id());
    spdlog::warn("{}: {}", connection_->peer_address(), error->message);
    if (error->fatal) registry_.metrics_.sessions_refused.Increment();
  }
  connection_->send(wire::serialize(message));
}

std::vector<std::uint64_t> Client::send(OutgoingFrame frame) {
  auto dropped = connection_->send(std::move(frame));
  registry_.metrics_.frames_dropped_by_server.Increment(static_cast<double>(dropped.size()));
  return dropped;
}

void Client::close(CloseCode code, std::string_view reason) { connection_->close(code, reason); }

template <typename Result, typename Handle>
std::function<void(Result)> Client::on_session_thread(Handle handle) {
  // Tracked work: the session thread does not end while an executor still owes an answer. The
  // client is moved on to it, so that its last reference never dies on a thread of the executor.
  auto executor = boost::asio::prefer(registry_.io_.get_executor(),
                                      boost::asio::execution::outstanding_work.tracked);
  return [self = shared_from_this(), executor, handle](Result result) mutable {
    boost::asio::post(executor,
                      [self = std::move(self), handle, result = std::move(result)]() mutable {
                        handle(*self, std::move(result));
                        self->registry_.give_frames();
                      });
  };
}

void Client::open_stream(StreamSettings settings) {
  executor_->open(stream_, std::move(settings),
                  on_session_thread<StreamOpened>([](Client& client, const StreamOpened& opened) {
                    client.session_.on_stream_opened(opened, Clock::now());
                  }));
}

void Client::start_frame(TimePoint now) {
  FrameOrder order = session_.start_frame(now);
  FrameJob job{stream_, order.ticket, order.request, order.real_fps, order.force_idr};
  registry_.scheduler_.frame_started();
  executor_->submit(
      std::move(job), on_session_thread<FrameResult>([](Client& client, FrameResult result) {
        client.registry_.scheduler_.frame_ended();
        Metrics& metrics = client.registry_.metrics_;
        (result.ok
             ? (result.frame.ticket.refined ? metrics.frames_refined : metrics.frames_rendered)
             : metrics.frames_failed)
            .Increment();
        metrics.list_entries_overflowed.Increment(
            static_cast<double>(result.stats.overflowed_entries));
        client.session_.on_frame(std::move(result), Clock::now());
      }));
}

}  // namespace catgs
