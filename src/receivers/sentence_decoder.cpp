#include "urban_gnss_localization/receivers/sentence_decoder.hpp"

namespace urban_gnss {

void SentenceDecoder::add(ReceiverRole role, const MessageView& message, Stamp arrival) {
  if (role == ReceiverRole::kSentence) decoder_.add(message.text("sentence"), stamp_of(message, arrival));
}

ReceiverOutput SentenceDecoder::take() {
  ReceiverOutput output = decoder_.take();
  const ReceiverOutput own = ReceiverDecoder::take();
  output.warnings.insert(output.warnings.begin(), own.warnings.begin(), own.warnings.end());
  return output;
}

}  // namespace urban_gnss
